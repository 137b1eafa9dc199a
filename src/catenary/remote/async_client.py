"""Client of the remote service for asyncio: `catenary.connect_async` creates it."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from catenary.errors import CatenaryError, ResponseTimeout, ShareError
from catenary.remote.client import GRACE
from catenary.remote.connection import (
    Answer,
    decode_response,
    encode_request,
    lost,
    open_connection,
    retry_time,
)
from catenary.remote.messages import MESSAGE_SIZE, TIMEOUT


async def connect_async(
    name: str, *, uid: int | None = None, timeout: float = TIMEOUT
) -> AsyncClient:
    """Connect to the program that owns the share `name`, for asyncio.

    Use the result in an `async with` block.

    Args:
        name: Name of the share.
        uid: Owner of the share; None: this user or root.
        timeout: Default deadline of a request [s].

    Returns:
        The client of the share's program.

    Raises:
        ShareError: The share does not exist or has no service, its program does not answer, or it
            belongs to another user.
        ValueError: The name is invalid.
    """
    connection = await asyncio.to_thread(open_connection, name, uid)
    return AsyncClient(name, connection, timeout)


class AsyncClient:
    """Requests to the program that owns a share, for asyncio.

        async with await cat.connect_async("arm") as arm:
            for device in await arm.call("devices"):
                print(device.position, device.name, device.state)

    The methods and results of `call` are those of `Client`. Several requests may wait at a time.
    """

    def __init__(self, name: str, connection: socket.socket, timeout: float) -> None:
        self.name = name
        self._connection = connection
        self._connection.setblocking(False)
        self._timeout = timeout
        self._serial = 0
        self._waiting: dict[int, tuple[Answer, asyncio.Future[Answer]]] = {}
        self._error: CatenaryError | None = None
        self._receiver = asyncio.get_running_loop().create_task(self._receive())

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connection. Waiting requests raise ShareError."""
        self._receiver.cancel()
        with suppress(asyncio.CancelledError):
            await self._receiver
        self._fail(lost(self.name))
        self._connection.close()

    async def call(self, method: str, /, *, timeout: float | None = None, **params: Any) -> Any:
        """Call a method, wait for its result and return it, or raise its error.

        If the service is busy, repeat the request until the deadline.

        Args:
            method: Name of a method of `Client`, such as "devices".
            timeout: Deadline [s]; None: that of the client.
            **params: Arguments of the method.

        Returns:
            The value that `messages.RESULTS` names for the method.
        """
        clock = asyncio.get_running_loop().time
        deadline = clock() + (self._timeout if timeout is None else timeout)
        while True:
            try:
                return await self._once(method, max(deadline - clock(), 0.0), params)
            except ShareError as error:
                pause = retry_time(error)
                if pause is None or clock() + pause >= deadline:
                    raise
                await asyncio.sleep(pause)

    async def _once(self, method: str, timeout: float, params: Mapping[str, Any]) -> Any:
        if self._error is not None:
            raise self._error
        loop = asyncio.get_running_loop()
        self._serial += 1
        serial = self._serial
        message = encode_request(serial, method, timeout, params)
        complete: asyncio.Future[Answer] = loop.create_future()
        self._waiting[serial] = Answer(), complete
        try:
            async with asyncio.timeout(timeout + GRACE):
                await loop.sock_sendall(self._connection, message)
                return (await complete).result(method)
        except TimeoutError as error:
            raise ResponseTimeout(
                f"the program of the share {self.name!r} did not answer {method!r} within "
                f"{timeout:g} s",
                hint="check if it is stopped or overloaded; allow more time with timeout=",
            ) from error
        except OSError as error:
            raise lost(self.name) from error
        finally:
            self._waiting.pop(serial, None)

    async def _receive(self) -> None:
        """Pass each response to the request that waits for it, until the connection ends."""
        loop = asyncio.get_running_loop()
        try:
            while message := await loop.sock_recv(self._connection, MESSAGE_SIZE):
                response = decode_response(message)
                if response.serial in self._waiting:
                    answer, complete = self._waiting[response.serial]
                    answer.add(response)
                    if answer.complete and not complete.done():
                        complete.set_result(answer)
            self._fail(lost(self.name))
        except OSError:
            self._fail(lost(self.name))
        except CatenaryError as error:
            self._fail(error)

    def _fail(self, error: CatenaryError) -> None:
        self._error = self._error or error
        for _, complete in self._waiting.values():
            if not complete.done():
                complete.set_exception(error)

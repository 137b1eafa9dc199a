"""Requests to the program of a loop, with an allow-list for each role."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING

from catenary.dashboard.security import Role
from catenary.errors import BusyError, CatenaryError, ResponseTimeout, ShareError

if TYPE_CHECKING:
    from catenary.remote import Client

FAILURES = (CatenaryError, OSError, RuntimeError, TypeError, ValueError)  # of a request
CONNECTIONS = 6
CALLS_MAX = 32  # calls that wait or run
VIEWER_CALLS_MAX = 16  # the rest is for operators
RETRY_SECONDS = 0.2
READS = frozenset(
    {
        *("hello", "devices", "axes", "objects", "sdo_read", "diagnosis"),
        *("emergencies", "events", "timing", "clocks", "plan", "laws", "modes"),
    }
)
WRITES = frozenset(
    {
        *("sdo_write", "set_state", "reset_error", "clear_counters", "set_parameters", "home"),
        *("set_mode", "run_preset"),
        *("virtual_cable", "virtual_power", "virtual_push"),
        "registers",  # reading can change a device: it empties a mailbox, or resets a latch
    }
)


class Requests:
    """Connections to the program of a share, one for each request in progress.

    Args:
        share: name of the share.
        uid: owner of the share; None: this user or root.
    """

    def __init__(self, share: str, uid: int | None = None) -> None:
        self._share = share
        self._uid = uid
        self._idle: list[Client] = []
        self._lock = threading.Lock()
        self._generation = 0
        self._running = asyncio.Semaphore(CONNECTIONS)
        self._waiting = 0
        self._answers = True
        self._pool = ThreadPoolExecutor(CONNECTIONS, "dashboard requests")

    def is_available(self) -> bool:
        """Return False if the last request found no service in the program."""
        return self._answers

    def reset(self) -> None:
        """Close the connections, because the share has changed."""
        with self._lock:
            self._generation += 1
            idle, self._idle = self._idle, []
        for client in idle:
            client.close()
        self._answers = True

    def close(self) -> None:
        """Close the connections, without waiting for requests in progress."""
        self.reset()
        self._pool.shutdown(wait=False, cancel_futures=True)

    async def call(
        self,
        method: str,
        params: Mapping[str, object],
        *,
        timeout: float | None = None,
        limit: int = CALLS_MAX,
    ) -> object:
        """Return the result of a method of `catenary.remote.Client`.

        Args:
            method: name of the method.
            params: its arguments.
            timeout: deadline [s]; None: that of the client.
            limit: number of requests in progress from which this one is refused.

        Raises:
            CatenaryError: the program refused the request, or does not answer.
            BusyError: too many requests are waiting.
            RuntimeError: the state of the program does not permit the request.
            TypeError: the arguments do not fit the method.
            ValueError: a value is not valid.
        """
        if self._waiting >= limit:
            raise BusyError(f"{limit} requests are already waiting", retry=RETRY_SECONDS)
        self._waiting += 1
        try:
            async with self._running:
                work = partial(self._call, method, params, timeout)
                return await asyncio.get_running_loop().run_in_executor(self._pool, work)
        finally:
            self._waiting -= 1

    def _call(self, method: str, params: Mapping[str, object], timeout: float | None) -> object:
        if "timeout" in params:
            raise ValueError("the server chooses the deadline; omit `timeout`")
        client, generation = self._take()
        keep = False
        try:
            result: object = client.call(method, timeout=timeout, **params)
            keep = True
        except (ShareError, ResponseTimeout, OSError):
            raise
        except Exception:
            keep = True  # the program has answered with an error
            raise
        finally:
            self._give_back(client, generation, keep)
        return result

    def _take(self) -> tuple[Client, int]:
        from catenary.remote import connect

        with self._lock:
            generation = self._generation
            if self._idle:
                return self._idle.pop(), generation
        try:
            client = connect(self._share, uid=self._uid)
        except CatenaryError:
            self._answers = False
            raise
        self._answers = True
        return client, generation

    def _give_back(self, client: Client, generation: int, keep: bool) -> None:
        with self._lock:
            if keep and generation == self._generation:
                self._idle.append(client)
                return
        client.close()


def is_allowed(method: str, role: Role) -> bool:
    """Return True if a role may call a method."""
    return method in READS or (role == "operator" and method in WRITES)


def error_body(error: Exception) -> dict[str, str]:
    """Return an error as the page receives it."""
    return {
        "kind": type(error).__name__,
        "message": str(getattr(error, "message", "") or error),
        "hint": str(getattr(error, "hint", "")),
    }

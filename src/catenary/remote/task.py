"""Execution of one request in slices, and the encoding of its response."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Generator
from typing import Any

import msgspec

from catenary.errors import CatenaryError, ResponseTimeout
from catenary.remote.listener import Connection
from catenary.remote.messages import (
    PART_SIZE,
    RESULT_SIZE,
    TIMEOUT_MAX,
    VERSION,
    Failure,
    Request,
    Response,
)
from catenary.remote.methods import Methods

CALLER_ERRORS = (ValueError, TypeError, RuntimeError, IndexError)


class Task:
    """Request of a client, from its first slice to its response."""

    def __init__(self, connection: Connection, request: Request) -> None:
        self.connection = connection
        self.request = request
        self.succeeded = False
        self._deadline = time.monotonic() + request.timeout
        self._work: Generator[bool | None, None, Any] | None = None

    def start(self, methods: Methods) -> list[bytes] | None:
        """Begin the request. Return the messages of its answer if it is already complete."""
        request = self.request
        if not 0 <= request.timeout <= TIMEOUT_MAX:
            return self._failed(
                ValueError(f"timeout={request.timeout} s: must be 0 to {TIMEOUT_MAX:g}")
            )
        peer = self.connection.peer
        return self._attempt(lambda: methods.start(request.method, request.params, peer))

    def step(self, until: float) -> list[bytes] | None:
        """Continue the request until it waits, ends, or the time `until` has come.

        Return the messages of its answer if it is complete. At the deadline, it is an error.

        Args:
            until: End of the slice, on the clock of `time.perf_counter` [s].
        """
        while True:
            if time.monotonic() > self._deadline:
                return self._expire()
            assert self._work is not None
            try:
                waits = next(self._work)
            except StopIteration as end:
                return self._response(end.value)
            except Exception as error:  # the service must survive an error in a method
                return self._failed(error)
            if waits or time.perf_counter() >= until:
                return None

    def cancel(self, error: Exception) -> list[bytes]:
        """End the request, and return the messages of this answer."""
        if self._work is not None:
            self._work.close()
        return self._failed(error)

    def _attempt(self, call: Callable[[], Any]) -> list[bytes] | None:
        try:
            result = call()
        except Exception as error:  # the service must survive an error in a method
            return self._failed(error)
        if not isinstance(result, Generator):
            return self._response(result)
        self._work = result
        return None

    def _expire(self) -> list[bytes]:
        return self.cancel(
            ResponseTimeout(
                f"{self.request.method}: no result within {self.request.timeout:g} s",
                hint="the loop may not be iterated, or a device does not answer; a write may have "
                "taken effect",
            )
        )

    def _response(self, result: object) -> list[bytes]:
        encoded = msgspec.msgpack.encode(result)
        if len(encoded) > RESULT_SIZE:
            text = f"the result has {len(encoded)} bytes; the maximum is {RESULT_SIZE}"
            return self._failed(ValueError(f"{self.request.method}: {text}"))
        self.succeeded = True
        serial = self.request.serial
        return [
            msgspec.msgpack.encode(
                Response(VERSION, serial, None, part, more=at + PART_SIZE < len(encoded))
            )
            for at in range(0, len(encoded), PART_SIZE)
            for part in (encoded[at : at + PART_SIZE],)
        ]

    def _failed(self, error: Exception) -> list[bytes]:
        return [encode_error(self.request.serial, error)]


def encode_error(serial: int, error: Exception) -> bytes:
    """Encode an error as the answer to a request."""
    return msgspec.msgpack.encode(Response(VERSION, serial, failure_of(error)))


def failure_of(error: Exception) -> Failure:
    """Return an exception as the error of a response. Unexpected ones are also logged."""
    if isinstance(error, CatenaryError):
        return Failure(
            kind=type(error).__name__,
            message=error.message,
            hint=error.hint,
            details={
                name: value
                for name, value in vars(error).items()
                if name not in ("message", "hint") and isinstance(value, int | float | str)
            },
        )
    for kind in CALLER_ERRORS:
        if isinstance(error, kind):
            name = "ValueError" if kind is IndexError else kind.__name__
            return Failure(kind=name, message=str(error))
    logging.getLogger("catenary").error("a remote request failed", exc_info=error)
    return Failure(kind="RuntimeError", message=f"internal error: {error!r}")

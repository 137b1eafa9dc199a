"""Connection of a client to the remote service of a share, and the errors of its requests."""

from __future__ import annotations

import socket
import time
from collections.abc import Mapping
from typing import Any

import msgspec

from catenary import errors
from catenary.errors import BusyError, CatenaryError, ShareError
from catenary.remote.messages import (
    MESSAGE_SIZE,
    RESULT_SIZE,
    RESULTS,
    VERSION,
    Failure,
    Request,
    Response,
)
from catenary.share import folder
from catenary.share.desk_socket import CREDENTIALS

REMOTE = "remote"  # prefix of the socket's file name
CONNECT_TIMEOUT = 2.0  # [s]
PAUSE = 0.002  # [s] between two attempts to connect
PYTHON_ERRORS: Mapping[str, type[Exception]] = {
    kind.__name__: kind for kind in (ValueError, TypeError, RuntimeError)
}


def open_connection(name: str, uid: int | None) -> socket.socket:
    """Return a connected socket to the service of a share.

    Args:
        name: Name of the share.
        uid: Owner of the share; None: this user or root.

    Raises:
        ShareError: The share does not exist or has no service, its program does not answer, or it
            belongs to another user.
        ValueError: The name is invalid.
    """
    file = folder.file_name(REMOTE, name)
    try:
        path = folder.find(file, uid)
        owner = path.lstat().st_uid
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_CLOEXEC)
        try:
            _connect(connection, str(path))
            _check_owner(connection, name, owner)
        except BaseException:
            connection.close()
            raise
    except FileNotFoundError as error:
        others = ", ".join(map(repr, folder.names(uid))) or "none"
        raise ShareError(
            f"no program serves requests for the share {name!r}; existing shares: {others}",
            hint="the service runs while a Loop with sink=cat.Share(...) is open",
        ) from error
    except PermissionError as error:
        raise ShareError(
            f"no permission to send requests to the share {name!r}",
            hint="its writer can allow it: cat.Share(..., mode=0o660) for the group",
        ) from error
    except OSError as error:
        raise ShareError(
            f"the program of the share {name!r} does not answer: {error.strerror or error}",
            hint="it has ended or is stopped; start it again",
        ) from error
    return connection


def encode_request(serial: int, method: str, timeout: float, params: Mapping[str, Any]) -> bytes:
    """Encode a request.

    Args:
        serial: Number of the request, which the response repeats.
        method: Name of the method.
        timeout: Time after which no answer is needed [s].
        params: Arguments by name.

    Raises:
        ValueError: The method is unknown, or the message is too long.
    """
    if method not in RESULTS:
        raise ValueError(f"unknown method {method!r}; methods: {', '.join(RESULTS)}")
    message = msgspec.msgpack.encode(Request(VERSION, serial, method, timeout, dict(params)))
    if len(message) > MESSAGE_SIZE:
        raise ValueError(
            f"the request {method!r} has {len(message)} bytes; the maximum is {MESSAGE_SIZE}"
        )
    return message


def decode_response(message: bytes) -> Response:
    """Decode a response. Raises ShareError if it is invalid or has another version."""
    try:
        found = msgspec.msgpack.decode(message, type=Response)
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise ShareError(f"the program sent an invalid response: {error}") from error
    if found.version != VERSION:
        raise ShareError(
            f"the program uses version {found.version} of the remote messages, not {VERSION}",
            hint="use the same version of Catenary in both programs",
        )
    return found


class Answer:
    """Parts of the answer to one request, until the last one has arrived."""

    def __init__(self) -> None:
        self.complete = False
        self._error: Failure | None = None
        self._parts = bytearray()

    def add(self, response: Response) -> None:
        """Add the next part. Raises ShareError if the result is too long."""
        self._error = response.error
        self._parts += response.part
        self.complete = not response.more
        if len(self._parts) > RESULT_SIZE:
            raise ShareError(f"the program sent a result of more than {RESULT_SIZE} bytes")

    def result(self, method: str) -> Any:
        """Return the result as the type in `RESULTS`, or raise the error of the request."""
        if self._error is not None:
            raise error_of(self._error)
        return decode_result(method, bytes(self._parts))


def decode_result(method: str, encoded: bytes) -> Any:
    """Decode a result as the type in `RESULTS`. Raises ShareError if it is invalid.

    Args:
        method: Name of the method.
        encoded: The whole result.
    """
    try:
        return msgspec.msgpack.decode(encoded, type=RESULTS[method])
    except (msgspec.MsgspecError, ValueError, RecursionError) as error:
        raise ShareError(f"the program sent an invalid result of {method!r}: {error}") from error


def error_of(failure: Failure) -> Exception:
    """Return the exception of a failed request, of the class that the service names."""
    if failure.kind in PYTHON_ERRORS:
        hint = f"\n  hint: {failure.hint}" if failure.hint else ""
        return PYTHON_ERRORS[failure.kind](failure.message + hint)
    kind = getattr(errors, failure.kind, None)
    if not isinstance(kind, type) or not issubclass(kind, CatenaryError):
        kind = CatenaryError
    try:
        error = kind(failure.message, hint=failure.hint, **failure.details)
    except TypeError:
        error = CatenaryError(failure.message, hint=failure.hint)
    return error


def lost(name: str) -> ShareError:
    """Return the error for a connection that the program of the share has closed."""
    return ShareError(
        f"the program of the share {name!r} closed the connection",
        hint="its loop has ended; connect again when it runs",
    )


def retry_time(error: Exception) -> float | None:
    """Return the pause before the next attempt [s]; None if the request must not be repeated."""
    return error.retry if isinstance(error, BusyError) else None


def _connect(connection: socket.socket, path: str) -> None:
    """Connect, and retry while the queue is full: the kernel then returns EAGAIN."""
    connection.settimeout(CONNECT_TIMEOUT)
    deadline = time.monotonic() + CONNECT_TIMEOUT
    while True:
        try:
            return connection.connect(path)
        except BlockingIOError:
            if time.monotonic() >= deadline:
                raise
        time.sleep(PAUSE)


def _check_owner(connection: socket.socket, name: str, owner: int) -> None:
    peer = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
    _, uid, _ = CREDENTIALS.unpack(peer)
    if uid != owner:
        raise ShareError(
            f"a process of user {uid} answers for the share {name!r} of user {owner}",
            hint="end that process",
        )

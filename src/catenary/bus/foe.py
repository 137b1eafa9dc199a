"""Foe: access to the files of one device, before and during a loop."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Protocol, TypeAlias, TypeVar

from catenary.bus.pending import Pending
from catenary.bus.runner import Watch
from catenary.bus.sdo import Conversations
from catenary.errors import CatenaryError, ConfigurationError, MailboxError
from catenary.procedure.exchange import Procedure
from catenary.procedure.foe import MAX_SIZE, read, write
from catenary.procedure.foe_exchange import ANSWER_TIMEOUT, BUSY_TIMEOUT, Patience, Progress
from catenary.procedure.mailbox import MailboxChannel
from catenary.procedure.station import Station
from catenary.wire.foe import Busy

T = TypeVar("T")
ProgressReport: TypeAlias = Callable[[int, int | None], object]
Contents: TypeAlias = bytes | bytearray | memoryview | PathLike[str]


class FileOwner(Protocol):
    """Interface to the device of the files; `SubDevice` implements it."""

    @property
    def main(self) -> Conversations: ...

    @property
    def station(self) -> Station: ...

    @property
    def file_channel(self) -> MailboxChannel | None: ...

    @property
    def error(self) -> CatenaryError | None: ...


class Foe:
    """Access to the files of one device (FoE).

    Example: `sub.foe.write("app.efw", Path("app.efw"), password=0x1234)`.

    `read` and `write` wait for the end of the transfer. While a loop runs, any thread except the
    iterating one may call them. The iterating thread uses `request` and `request_write`, which do
    not wait. A transfer then uses the acyclic frames of the loop, and does not delay the cycle.
    """

    def __init__(self, sub: FileOwner, *, unavailable: str = "") -> None:
        """Initialise the access.

        Args:
            sub: The device.
            unavailable: Reason why the master does not offer FoE; empty if it does.
        """
        self._sub = sub
        self._unavailable = unavailable
        self._state = Progress()  # of the last transfer

    @property
    def busy(self) -> str:
        """Progress that a busy device reports, such as "30/100 erase"; empty if it is not busy.

        Without the second number, the device does not state the total (SSC, ecatfoe.c).
        """
        busy = self._state.busy
        if busy is None:
            return ""
        total = f"/{busy.entire}" if busy.entire else ""
        return f"{busy.done}{total} {busy.text}".strip()

    def read(
        self,
        name: str,
        *,
        password: int = 0,
        max_size: int = MAX_SIZE,
        progress: ProgressReport | None = None,
        timeout: float = ANSWER_TIMEOUT,
        busy_timeout: float = BUSY_TIMEOUT,
    ) -> bytes:
        """Read a file of the device.

        Args:
            name: Name of the file in the device.
            password: Password, 32 bits; 0 if the device does not require one.
            max_size: Largest accepted size [bytes]. FoE does not announce the size of a file.
            progress: Function that is called with the number of bytes, and None, in the calling
                thread: after each packet, and if the device is busy. It must not use the device.
            timeout: Longest time until the device answers a packet [s].
            busy_timeout: Longest time for which the device may be busy with one packet [s].

        Raises:
            FoeError: The device refuses the request.
            ResponseTimeout: The device does not answer, or is busy for too long.
            MailboxError: The file exceeds `max_size`, or the device violates the protocol or does
                not support FoE.
            ValueError: The name, the password or a time is out of range.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        state = self._state = Progress()
        asked = self._read(name, password, max_size, state, _patience(timeout, busy_timeout))
        return self._run(asked, state, progress)

    def write(
        self,
        name: str,
        data: Contents,
        *,
        password: int = 0,
        progress: ProgressReport | None = None,
        timeout: float = ANSWER_TIMEOUT,
        busy_timeout: float = BUSY_TIMEOUT,
    ) -> None:
        """Write a file to the device.

        Args:
            name: Name of the file in the device.
            data: Contents: bytes, or the `Path` of a file.
            password: Password, 32 bits; 0 if the device does not require one.
            progress: Function that is called with the number of acknowledged bytes, and the number
                of all bytes, in the calling thread: after each packet, and if the device is busy.
                It must not use the device.
            timeout: Longest time until the device answers a packet [s].
            busy_timeout: Longest time for which the device may be busy with one packet [s].

        Raises:
            FoeError: The device refuses the file.
            ResponseTimeout: The device does not answer, or is busy for too long.
            MailboxError: The device violates the protocol, or does not support FoE.
            OSError: The file cannot be read.
            TypeError: `data` is neither bytes nor a path.
            ValueError: The name, the password, a time or the size of the file is out of range.
            RuntimeError: The caller is the iterating thread of a loop.
        """
        state = self._state = Progress()
        asked = self._write(name, data, password, state, _patience(timeout, busy_timeout))
        self._run(asked, state, progress)

    def request(self, name: str, *, password: int = 0, max_size: int = MAX_SIZE) -> Pending[bytes]:
        """Read a file while a loop runs, without waiting: poll `done`, then call `result()`.

        `result()` raises the error, if any. The arguments are those of `read`. Without a loop, the
        call waits for the end of the transfer.
        """
        asked = self._read(name, password, max_size, Progress(), Patience())
        return self._sub.main.request(asked)

    def request_write(self, name: str, data: Contents, *, password: int = 0) -> Pending[None]:
        """Write a file while a loop runs, without waiting: poll `done`, then call `result()`.

        `result()` raises the error, if any. The arguments are those of `write`. Without a loop, the
        call waits for the end of the transfer.
        """
        asked = self._write(name, data, password, Progress(), Patience())
        return self._sub.main.request(asked)

    def _run(self, asked: Procedure[T], state: Progress, progress: ProgressReport | None) -> T:
        """Run a transfer. If the wait is interrupted, a loop ends the transfer."""
        try:
            return self._sub.main.converse(asked, _watch(state, progress))
        except BaseException:
            state.stopped = True
            raise

    def _read(
        self, name: str, password: int, max_size: int, state: Progress, patience: Patience
    ) -> Procedure[bytes]:
        channel = self._channel()
        return read(
            channel,
            name,
            password=password,
            max_size=max_size,
            progress=state,
            patience=patience,
        )

    def _write(
        self, name: str, data: Contents, password: int, state: Progress, patience: Patience
    ) -> Procedure[None]:
        channel, contents = self._channel(), contents_of(data)
        return write(channel, name, contents, password=password, progress=state, patience=patience)

    def _channel(self) -> MailboxChannel:
        """Return the mailbox of the device in its present state."""
        sub = self._sub
        if self._unavailable:
            raise ConfigurationError(f"{sub.station}: {self._unavailable}")
        channel = sub.file_channel
        if channel is not None:
            return channel
        if sub.error is not None:
            raise sub.error
        raise MailboxError(
            f"{sub.station} has no mailbox: cannot access its files",
            hint="couplers and simple terminals have no files",
        )


def contents_of(data: Contents) -> bytes:
    """Return the contents: bytes, or those of a file of at most `MAX_SIZE` bytes.

    Args:
        data: Bytes, or the path of a file.

    Raises:
        OSError: The file cannot be read.
        TypeError: `data` is neither bytes nor a path.
        ValueError: The file is too large.
    """
    if isinstance(data, (bytes, bytearray, memoryview)):
        return bytes(data)
    if not isinstance(data, PathLike):
        raise TypeError(f"{data!r} is neither bytes nor a path: use pathlib.Path for a file name")
    with Path(data).open("rb") as file:
        contents = file.read(MAX_SIZE + 1)
    if len(contents) > MAX_SIZE:
        raise ValueError(f"{data} exceeds {MAX_SIZE} bytes")
    return contents


def _patience(timeout: float, busy_timeout: float) -> Patience:
    for name, seconds in (("timeout", timeout), ("busy_timeout", busy_timeout)):
        if not 0 < seconds < float("inf"):
            raise ValueError(f"{name} must be positive and finite, not {seconds} s")
    return Patience(timeout, busy_timeout)


def _watch(state: Progress, progress: ProgressReport | None) -> Watch | None:
    """Return the function that reports each change of the progress; None without a report."""
    if progress is None:
        return None
    reported: tuple[int, Busy | None] | None = None

    def watch() -> None:
        nonlocal reported
        if (state.done, state.busy) != reported:
            reported = state.done, state.busy
            progress(state.done, state.total)

    return watch

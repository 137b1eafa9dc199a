"""Unbuffered output to a file, so that a killed recorder loses no byte that was written."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from catenary.errors import RecordingError


class Output:
    """Owner of the descriptor and the lock of an output file."""

    def __init__(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Create the file and lock it.

        Args:
            path: the file.
            force: replace an existing file.

        Raises:
            FileExistsError: The file exists (without `force`).
            RecordingError: Another recorder is writing the file.
        """
        new = 0 if force else os.O_EXCL
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | new, 0o666)
        self._position = 0
        try:
            lock(self._fd, path)
            os.ftruncate(self._fd, 0)
        except BaseException:
            self.close()
            raise

    def write(self, data: bytes) -> int:
        """Write all bytes. Return their number."""
        rest = memoryview(data)
        while rest:
            written = os.write(self._fd, rest)
            self._position += written
            rest = rest[written:]
        return len(data)

    def tell(self) -> int:
        """Return the number of bytes written."""
        return self._position

    def close(self) -> None:
        """Close the file, which releases the lock."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


def lock(fd: int, path: str | os.PathLike[str]) -> None:
    """Lock a file for writing until its descriptor is closed.

    Args:
        fd: descriptor of the file.
        path: path of the file, for the message.

    Raises:
        RecordingError: Another process has the lock.
    """
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise RecordingError(
            f"{Path(path)} is being written by another recorder",
            hint="stop that recorder first, or use another name",
        ) from error

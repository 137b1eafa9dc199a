"""Unbuffered output to a file: a killed recorder has written all the bytes that it was given."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from catenary.errors import RecordingError


class Output:
    """Owner of the descriptor and the lock of a file that is written from its beginning."""

    def __init__(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """Create the file; `force` replaces an existing one.

        Raises:
            FileExistsError: the file exists (without `force`).
            RecordingError: another recorder writes it.
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
        rest = memoryview(data)
        while rest:
            written = os.write(self._fd, rest)
            self._position += written
            rest = rest[written:]
        return len(data)

    def tell(self) -> int:
        return self._position

    def close(self) -> None:
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


def lock(fd: int, path: str | os.PathLike[str]) -> None:
    """Lock the file for writing until the descriptor is closed.

    Raises RecordingError if another process has the lock.
    """
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise RecordingError(
            f"{Path(path)} is being recorded by another process",
            hint="end that recorder first, or choose another name",
        ) from error

"""Bytes to a file, all or an error: nothing is kept back, so that a killed recorder has written all
that it was given."""

from __future__ import annotations

import os


class Output:
    """Owns the descriptor of a file that is written from its beginning."""

    def __init__(self, path: str | os.PathLike[str], *, force: bool = False) -> None:
        """FileExistsError unless `force`, which begins the file anew."""
        new = os.O_TRUNC if force else os.O_EXCL
        self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC | new, 0o666)
        self._position = 0

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

"""Places in ESI files, and the warnings of the reader."""

from __future__ import annotations

from typing import NamedTuple


class Source(NamedTuple):
    """Place of an element: name of the file, and line from 1."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}"


NO_SOURCE = Source("", 0)  # of values that do not come from a file


class EsiWarning(NamedTuple):
    """Fault of an ESI file that the reader could ignore or repair."""

    source: Source
    message: str

    def __str__(self) -> str:
        return f"{self.source}: {self.message}"

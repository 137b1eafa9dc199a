"""Clones of segments: folders with everything that can be read from the devices.

    line = read_line("line/")
    line.devices[1].value(0x1008, 0)  # b"AX5101"

`catenary clone` and `catenary.clone` write them; `virtual:line/` serves one as a segment.
"""

from __future__ import annotations

from catenary.line.reader import read_device, read_line
from catenary.line.values import (
    ClonedAssignment,
    ClonedDevice,
    ClonedEntry,
    ClonedObject,
    ClonedPdo,
    Line,
    MappedEntry,
)
from catenary.line.writer import write_line

__all__ = [
    "ClonedAssignment",
    "ClonedDevice",
    "ClonedEntry",
    "ClonedObject",
    "ClonedPdo",
    "Line",
    "MappedEntry",
    "read_device",
    "read_line",
    "write_line",
]

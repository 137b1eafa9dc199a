"""Repair of a recording that a full disk or a killed recorder has truncated.

The repair is done in place, because a full disk has no room for a second file. It removes the
incomplete end, and writes the index and the summary that PlotJuggler needs. If these do not fit, it
removes chunks from the end until they do.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from catenary.record.mcap_records import MAGIC, refusing_damage
from catenary.record.output import lock
from catenary.record.summary import Summary, encode_end, read_complete_part

CUT_OFF = {"ended": "cut off, and repaired"}


@dataclass(frozen=True, slots=True)
class Repaired:
    """Result of a repair.

    `repaired` is False if the file was complete. `dropped` is the number of bytes removed from its
    end, `chunks` the number of remaining chunks, and `seconds` their duration [s].
    """

    repaired: bool
    dropped: int
    chunks: int
    seconds: float


def is_whole(path: str | os.PathLike[str]) -> bool:
    """Return True if the file ends with the final bytes of an MCAP file."""
    with Path(path).open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        stream.seek(max(size - len(MAGIC), 0))
        return size > 2 * len(MAGIC) and stream.read() == MAGIC


def repair(path: str | os.PathLike[str], *, end: Mapping[str, object] | None = None) -> Repaired:
    """Repair a truncated recording in place.

    Args:
        path: the file.
        end: entries of the end record; None marks the recording as cut off.

    Raises:
        RecordingError: The file is not a recording, or a recorder is writing it.
        OSError: The file cannot be opened, or not even an empty summary fits on the disk.
    """
    with Path(path).open("r+b", buffering=0) as stream:
        lock(stream.fileno(), path)
        before = os.fstat(stream.fileno()).st_size
        with refusing_damage(stream.name):
            summary = read_complete_part(stream)
        if is_whole(path):
            return Repaired(False, 0, len(summary.chunks), summary.seconds)
        entries = {key: str(value) for key, value in (end or CUT_OFF).items()}
        while not _write_end(stream, summary, entries):
            summary.drop_last_chunk()
    dropped = max(before - summary.end, 0)
    return Repaired(True, dropped, len(summary.chunks), summary.seconds)


def _write_end(stream: BinaryIO, summary: Summary, entries: dict[str, str]) -> bool:
    """Write the end of the file. Return False if it does not fit and a chunk can be removed.

    Raises OSError if it does not fit and the file has no chunk left.
    """
    data = memoryview(encode_end(summary, entries))
    try:
        stream.truncate(summary.end)
        stream.seek(summary.end)
        while data:
            data = data[stream.write(data) :]
    except OSError:
        if not summary.chunks:
            raise
        return False
    return True

"""Repair of a truncated recording, after a full disk or if the recorder was killed.

The repair is in place, because a full disk has no room for a second file. It drops the incomplete
end, and writes the index and the summary that PlotJuggler needs. If these do not fit, it drops
chunks from the end until they do.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from catenary.record.mcap_records import MAGIC, refusing_damage
from catenary.record.output import lock
from catenary.record.summary import Summary, encode_end, find_whole

CUT_OFF = {"ended": "cut off, and repaired"}


@dataclass(frozen=True, slots=True)
class Repaired:
    """Result of a repair.

    `repaired`: False if the file was complete; `dropped`: number of bytes dropped from its end;
    `chunks`: number of chunks left; `seconds`: their duration [s].
    """

    repaired: bool
    dropped: int
    chunks: int
    seconds: float


def is_whole(path: str | os.PathLike[str]) -> bool:
    """Return True if the file ends as an MCAP file must."""
    with Path(path).open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        stream.seek(max(size - len(MAGIC), 0))
        return size > 2 * len(MAGIC) and stream.read() == MAGIC


def repair(path: str | os.PathLike[str], *, end: Mapping[str, object] | None = None) -> Repaired:
    """Repair a truncated recording in place.

    Args:
        path: the file.
        end: entries of the end record; None: as for a truncated file.

    Raises:
        RecordingError: not a recording, or it is being recorded.
        OSError: no room even for an empty summary.
    """
    with Path(path).open("r+b", buffering=0) as stream:
        lock(stream.fileno(), path)
        before = os.fstat(stream.fileno()).st_size
        with refusing_damage(stream.name):
            summary = find_whole(stream)
        if is_whole(path):
            return Repaired(False, 0, len(summary.chunks), summary.seconds)
        words = {key: str(value) for key, value in (end or CUT_OFF).items()}
        while not _write_end(stream, summary, words):
            summary.drop_last_chunk()
    dropped = max(before - summary.end, 0)
    return Repaired(True, dropped, len(summary.chunks), summary.seconds)


def _write_end(stream: BinaryIO, summary: Summary, words: dict[str, str]) -> bool:
    """Write the summary. Return False if it does not fit, but dropping a chunk would help."""
    data = memoryview(encode_end(summary, words))
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

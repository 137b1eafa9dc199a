"""Makes a recording whole that was cut off: by a full disk, or because the recorder was killed.

In place, since a full disk has no room for a second file. What is not whole at the end is dropped;
behind the rest go the index and the summary that programs ask for (PlotJuggler opens nothing
without them). Where even these find no room, chunks are dropped from the end until they do.
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
    """What became of a file. `repaired`: False, it was whole; `dropped`: bytes at its end that were
    not whole or found no room; `chunks`: how many are left; `seconds`: how long these last."""

    repaired: bool
    dropped: int
    chunks: int
    seconds: float


def is_whole(path: str | os.PathLike[str]) -> bool:
    """Whether the file ends as an MCAP file does."""
    with Path(path).open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        stream.seek(max(size - len(MAGIC), 0))
        return size > 2 * len(MAGIC) and stream.read() == MAGIC


def repair(path: str | os.PathLike[str], *, end: Mapping[str, object] | None = None) -> Repaired:
    """Makes a cut-off recording whole, in place. `end`: what to say of its end. RecordingError: it
    is no recording, or is being made; OSError: there is no room even for a summary of nothing."""
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
    """False: there is no room for it, and there is a chunk whose room it could have."""
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

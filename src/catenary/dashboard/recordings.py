"""Recordings of a folder as a source for the same views as the live signals.

    GET  /api/recordings                {files: [{name, size, modified}]}
    GET  /api/recordings/NAME           layout, duration and events
    POST /api/recordings/NAME/window    {signals, start, end, points}: a frame of kind 1 or 2

A window with at most `points` cycles contains all of them (kind 1). A larger one contains the
minimum and the maximum of `points` intervals (kind 2). Times count from the first cycle [s].
A large window is read step by step: until it is complete, the answer is 202 {progress}.
"""

from __future__ import annotations

import math
import time
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
import numpy.typing as npt

from catenary.dashboard.frames import (
    DECIMATED,
    Column,
    Frame,
    Rows,
    column_of,
    encode_full,
    find_columns,
)
from catenary.errors import RecordingError
from catenary.record.index import ChunkPlace, RecordingIndex
from catenary.record.layout import TIME

FILES_MAX = 1000
EVENTS_MAX = 2000
POINTS_MAX = 20_000
SIGNALS_MAX = 64
WINDOW_BYTES = 64 << 20  # rows of a window that is read at once
STEP = 0.25  # [s] of work for one answer
CACHED = 300_000  # cached extremes of each recording: chunks times signals
BINS = 16  # intervals of a chunk in a large window
OPEN_MAX = 4  # recordings

EMPTY = Frame(DECIMATED, 0, 0, 0, 0, 0.0, b"")
Floats = npt.NDArray[np.float64]


class Window(msgspec.Struct, frozen=True):
    """Request for a part of a recording."""

    signals: list[str]
    start: float  # [s] after the first cycle
    end: float
    points: int = 2000


class Progress(msgspec.Struct, frozen=True):
    """Part of a window that has been read, from 0 to 1."""

    progress: float


class Folder:
    """Recordings (*.mcap) of one folder; subfolders and links to other folders are ignored."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        self._open: OrderedDict[tuple[str, int, int], OpenRecording] = OrderedDict()

    def files(self) -> list[dict[str, object]]:
        """Return name, size [bytes] and time of modification (UTC [s]) of the newest files."""
        found = [(path, path.stat()) for path in self._folder.glob("*.mcap") if self._is_own(path)]
        found.sort(key=lambda each: -each[1].st_mtime)
        return [
            {"name": path.name, "size": stat.st_size, "modified": stat.st_mtime}
            for path, stat in found[:FILES_MAX]
        ]

    def open(self, name: str) -> OpenRecording:
        """Return a recording. A few recordings stay open.

        Raises:
            RecordingError: The file does not exist, or is not a recording.
        """
        path = self._folder / name
        if not self._is_own(path) or path.suffix != ".mcap":
            raise RecordingError(f"there is no recording {name!r}")
        stat = path.stat()
        key = (name, stat.st_mtime_ns, stat.st_size)
        if key not in self._open:
            self._open[key] = OpenRecording(RecordingIndex(path))
        self._open.move_to_end(key)
        while len(self._open) > OPEN_MAX:
            self._open.popitem(last=False)
        return self._open[key]

    def _is_own(self, path: Path) -> bool:
        return path.is_file() and path.resolve().parent == self._folder


class OpenRecording:
    """An indexed recording, with the extremes of the chunks that were read."""

    def __init__(self, index: RecordingIndex) -> None:
        self._index = index
        self._extremes: OrderedDict[tuple[int, Column], Floats] = OrderedDict()

    def describe(self) -> dict[str, object]:
        """Return layout, duration, end and the first events, with times after the first cycle."""
        index, layout = self._index, self._index.layout
        start = index.start_ns * 1e-9
        return {
            "layout": msgspec.to_builtins(layout),
            "duration": index.duration,
            "started": (index.start_ns + layout.utc_offset_ns) * 1e-9,
            "ended": index.ended,
            "lost": index.lost,
            "events": [
                {"time": e.time - start, "kind": e.kind, "message": e.message}
                for e in index.events()[:EVENTS_MAX]
            ],
        }

    def window(self, request: Window) -> Frame | Progress:
        """Return the frame of a window, or the progress if it needs more steps.

        Raises:
            RecordingError: The part is damaged.
            ValueError: The window is not valid, or a signal does not exist.
        """
        check(request)
        index = self._index
        columns = find_columns(index.layout, request.signals)
        start, end = max(request.start, 0.0), min(request.end, index.duration)
        size = max(end - start, 0.0) / index.layout.period * index.layout.dtype.itemsize
        if size > WINDOW_BYTES:
            return self._overview(columns, index.overlapping(start, end), request.points)
        rows = index.read(start, end).rows if start <= end else index.read(0.0, 0.0).rows[:0]
        if not len(rows):
            return EMPTY
        if len(rows) <= request.points:
            return encode_full(rows, columns, 0, index.layout.period)
        return encode_extremes(*decimated(rows, columns, request.points), index.layout.period)

    def _overview(
        self, columns: list[Column], chunks: list[ChunkPlace], points: int
    ) -> Frame | Progress:
        """Return the extremes of many chunks, or the progress after STEP seconds of work."""
        if len(chunks) * (1 + len(columns)) > CACHED:
            raise ValueError("the window is too long; choose a shorter one or fewer signals")
        deadline = time.monotonic() + STEP
        parts: list[Floats] = []
        for number, chunk in enumerate(chunks):
            if time.monotonic() > deadline:
                return Progress(number / len(chunks))
            parts.append(self._chunk_extremes(chunk, columns))
        low, high = merged(np.concatenate(parts, axis=2), points)
        return encode_extremes(low, high, self._index.layout.period)

    def _chunk_extremes(self, chunk: ChunkPlace, columns: list[Column]) -> Floats:
        """Return low and high of the time and each column, shape (2, 1 + columns, BINS or less)."""
        keys = [(chunk.place.offset, column) for column in ((TIME, None), *columns)]
        if not all(key in self._extremes for key in keys):
            rows = self._index.read(*self._index.span(chunk)).rows
            bounds = np.empty((2, len(keys), 0))
            if len(rows):
                bounds = np.stack(decimated(rows, columns, BINS))
            self._extremes |= {key: bounds[:, n] for n, key in enumerate(keys)}
        found = np.stack([self._extremes[key] for key in keys], axis=1)
        for key in keys:
            self._extremes.move_to_end(key)
        while len(self._extremes) > CACHED:
            self._extremes.popitem(last=False)
        return found


def check(request: Window) -> None:
    """Raise ValueError if a window is not valid."""
    if not 1 <= request.points <= POINTS_MAX:
        raise ValueError(f"points={request.points}: must be from 1 to {POINTS_MAX}")
    if not 1 <= len(request.signals) <= SIGNALS_MAX:
        raise ValueError(f"a window has 1 to {SIGNALS_MAX} signals")
    if not (math.isfinite(request.start) and math.isfinite(request.end)):
        raise ValueError("start and end must be finite")
    if request.end < request.start:
        raise ValueError("the end of the window is before its start")


def decimated(rows: Rows, columns: Sequence[Column], points: int) -> tuple[Floats, Floats]:
    """Return the extremes of intervals of rows. NaN is ignored, unless an interval has only NaN.

    Args:
        rows: cycles, at least one.
        columns: the signals.
        points: maximum number of intervals.

    Returns:
        Minimum and maximum of the time and of each column, each (1 + columns, intervals).
    """
    values = np.empty((1 + len(columns), len(rows)))
    values[0] = rows[TIME] * 1e-9
    for line, column in zip(values[1:], columns, strict=True):
        line[:] = column_of(rows, column)
    return merged(np.stack([values, values]), points)


def merged(bounds: Floats, points: int) -> tuple[Floats, Floats]:
    """Merge neighbouring intervals.

    Args:
        bounds: low and high, shape (2, lines, intervals).
        points: maximum number of intervals.

    Returns:
        Low and high, each (lines, intervals).
    """
    low, high = bounds
    count = low.shape[1]
    if count <= points:
        return low, high
    starts = np.linspace(0, count, points, endpoint=False).astype(np.intp)
    return np.fmin.reduceat(low, starts, axis=1), np.fmax.reduceat(high, starts, axis=1)


def encode_extremes(low: Floats, high: Floats, period: float) -> Frame:
    """Return the frame of extremes.

    Args:
        low: minimum of the time and of each signal, (1 + signals, intervals).
        high: maximum of the same.
        period: period of the loop [s].
    """
    signals, intervals = len(low) - 1, low.shape[1]
    pairs = np.stack([low[1:], high[1:]], axis=1).astype("<f4")
    body = low[0].astype("<f8").tobytes() + pairs.tobytes()
    return Frame(DECIMATED, intervals, signals, 0, 0, period, body)

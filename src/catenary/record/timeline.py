"""Timeline of a recording: cycle timing over time, with events and quick stops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary.record.layout import NUMBER
from catenary.record.recording import Recording
from catenary.record.series import count_of, peaks, phase_us
from catenary.wire.cia402 import QUICK_STOP_COMMAND

MARKED = 40  # maximum number of marks; more would hide the lines
NAMED = 24  # maximum number of names; the table of the page has the others
LEVELS, LEVEL_HEIGHT = 4, 0.12  # the names are on 4 levels, each 12 % of the height of the plot
EVENT, STOP = "#b42318", "#1d2430"
COLORS = {"lateness": "#b9c2cc", "in_controller": "#2f6f9f"}


@dataclass(frozen=True, slots=True)
class Mark:
    """A vertical line in a plot, for an event or a quick stop."""

    time: float  # [s] since the first cycle
    text: str
    color: str
    dashes: tuple[float, ...]


def marks_of(recording: Recording) -> list[Mark]:
    """Return the marks of events and of the starts of quick stops, sorted by time."""
    start = recording.start_ns * 1e-9
    events = [Mark(e.time - start, e.kind, EVENT, (3, 2)) for e in recording.events]
    stops = [
        Mark(float(recording.time[row]), stop_text(recording, axes), STOP, (1, 1.5))
        for row, axes in quick_stops(recording)
    ]
    return sorted(events + stops, key=lambda mark: mark.time)


def quick_stops(recording: Recording) -> list[tuple[int, list[int]]]:
    """Return the rows in which a quick stop starts, each with the numbers of its axes."""
    if recording.layout.field("controlword") is None or len(recording) < 2:
        return []
    stop = braking(recording)
    begins = stop[1:] & ~stop[:-1] & (np.diff(recording[NUMBER].astype(np.int64)) == 1)[:, None]
    rows = np.flatnonzero(begins.any(axis=1))
    return [(int(row) + 1, np.flatnonzero(begins[row]).tolist()) for row in rows]


def braking(recording: Recording) -> npt.NDArray[np.bool_]:
    """Return True for each cycle and axis whose controlword commands a quick stop.

    The shape is (cycles, axes).
    """
    mask, value = QUICK_STOP_COMMAND
    return np.asarray(recording["controlword"] & mask == value)


def stop_text(recording: Recording, axes: list[int]) -> str:
    """Return the label of the mark for a quick stop of these axes."""
    one = recording.axes[axes[0]]
    return f"quick stop: {one if len(axes) == 1 else count_of(len(axes), 'axis', 'axes')}"


def draw_marks(plot: Any, marks: list[Mark]) -> None:
    """Draw at most MARKED marks as vertical lines."""
    for mark in marks[:MARKED]:
        plot.axvline(mark.time, color=mark.color, lw=0.9, ls=(0, mark.dashes), zorder=1.5)


def draw_timeline(plot: Any, recording: Recording, marks: list[Mark], points: int) -> None:
    """Draw the cycle timing over time.

    Each point is the maximum of its interval, so that a single late cycle is visible.

    Args:
        plot: matplotlib Axes.
        recording: the recording.
        marks: events and quick stops to mark.
        points: number of points per line.
    """
    for phase, color in COLORS.items():
        values = phase_us(recording, phase)
        if values is not None and len(recording):
            time, top = peaks(recording.time, values, points)
            plot.plot(time, top, color=color, lw=0.9, label=phase.replace("_", " "))
    plot.set_title("cycle timing, maximum per pixel [µs]", loc="left", fontsize=10.0)
    if plot.lines:
        plot.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize=8.0, borderaxespad=0.1
        )
    draw_marks(plot, marks)
    _name_marks(plot, marks)
    plot.margins(x=0.01)
    plot.set_xlabel("time [s]")


def _name_marks(plot: Any, marks: list[Mark]) -> None:
    """Enlarge the plot at the top, and write at most NAMED names next to the lines.

    The names are on alternating levels, so that they do not overlap.
    """
    margin = 1.0 + LEVEL_HEIGHT * (1 + min(len(marks), LEVELS)) if marks else 1.0
    low, high = plot.get_ylim()
    plot.set_ylim(min(low, 0.0), max(high, 1.0) * margin)
    for place, mark in enumerate(marks[:NAMED]):
        is_late = mark.time > 0.8 * plot.get_xlim()[1]
        plot.annotate(
            mark.text, (mark.time, 0.99 - LEVEL_HEIGHT * (place % LEVELS)),
            xycoords=("data", "axes fraction"), color=mark.color, fontsize=8.0,
            xytext=(-3 if is_late else 3, 0), textcoords="offset points",
            ha="right" if is_late else "left", va="top",
        )  # fmt: skip
    if len(marks) > NAMED:
        plot.annotate(
            f"and {len(marks) - NAMED} more", (1.0, 0.5), xycoords="axes fraction", ha="right"
        )

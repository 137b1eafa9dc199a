"""Figures of a recording, drawn with matplotlib: one row per axis, with the cycle timing below.

The module does not use pyplot. It therefore has no global state and opens no window.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from catenary.errors import RecordingError
from catenary.record.extra import require
from catenary.record.recording import Recording
from catenary.record.series import (
    Floats,
    count_of,
    of_axes,
    prefix_for,
    reference_of,
    thin,
    timing_us,
    tracking_error,
    with_gaps,
)
from catenary.record.timeline import Mark, draw_marks, draw_timeline, marks_of

# Points per line, with few and with many axes: about two per pixel of a column.
POINTS, FEW_POINTS = 700, 350
WIDTH = 14.0  # [inch]
HEAD_HEIGHT, TIMELINE_HEIGHT, TIMING_HEIGHT = 0.9, 2.1, 2.5  # [inch]
MANY = 8  # axes above which the rows are low and the lines have few points
TALL_ROW, LOW_ROW = 1.75, 1.2  # [inch]
TIMES_EVERY = 8  # rows between two time scales
WIDE, NARROW = 3.4, 1.0  # line widths [points]
RESOLUTION = 110  # [pixels per inch]

INK, SOFT, RULE = "#1d2430", "#5f6b7a", "#dfe3e8"
REFERENCE, POSITION, ERROR, TORQUE, BAR = "#b9c2cc", "#0f6cbd", "#c2410c", "#15803d", "#2f6f9f"
STYLE = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.edgecolor": RULE,
    "axes.labelcolor": SOFT,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": RULE,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.frameon": False,
    "svg.fonttype": "none",  # text instead of outlines
    "svg.hashsalt": "catenary",  # equal figures result in equal files
}


@dataclass(frozen=True, slots=True)
class Line:
    """One quantity of all axes, drawn as one line per axis in the same style."""

    name: str
    values: Floats  # (cycles, axes)
    color: str
    width: float


@dataclass(frozen=True, slots=True)
class Column:
    """One quantity, drawn for every axis."""

    title: str  # with the unit
    lines: tuple[Line, ...]


def plot(
    recording: Recording,
    path: str | os.PathLike[str],
    *,
    axes: Sequence[str] | None = None,
    reference: str | None = None,
    unit: str = "rad",
) -> None:
    """Plot a recording into a .png, .svg, .pdf or .html file.

    Args:
        recording: the recording.
        path: output file; its suffix selects the format.
        axes: names of the axes to plot; None for all.
        reference: field to compare positions with; None for the commanded positions if any drive
            is in CSP.
        unit: unit of angles, "rad" or "deg".

    Raises:
        RecordingError: An axis or field is unknown, or matplotlib is not installed.
        ValueError: The unit or the file format is unknown.
    """
    from catenary.record.page import as_html

    reference = checked_reference(recording, reference)
    kind = Path(path).suffix.lower()
    if kind not in (".png", ".svg", ".pdf", ".html"):
        raise ValueError(f"{path}: a plot must be a .png, .svg, .pdf or .html file")
    with style():
        figure = draw(recording, axes=axes, reference=reference, unit=unit)
        if kind == ".html":
            Path(path).write_text(as_html(recording, figure, reference=reference, unit=unit))
        else:
            figure.savefig(path)


def style() -> Any:
    """Return the context in which figures are created and saved."""
    return require("matplotlib").rc_context(STYLE)


def draw(
    recording: Recording,
    *,
    axes: Sequence[str] | None = None,
    reference: str | None = None,
    unit: str = "rad",
) -> Any:
    """Return the matplotlib Figure of a recording.

    Args:
        recording: the recording.
        axes: names of the axes to plot; None for all.
        reference: field to compare positions with; None for the default.
        unit: unit of angles, "rad" or "deg".

    Raises:
        RecordingError: An axis or field is unknown, or matplotlib is not installed.
        ValueError: The unit is unknown.
    """
    chosen = choose(recording, axes)
    reference = checked_reference(recording, reference)
    columns = make_columns(recording, reference, unit)
    rows = len(chosen) if columns else 0
    row_height = TALL_ROW if rows <= MANY else LOW_ROW
    heights = [rows * row_height, TIMELINE_HEIGHT, TIMING_HEIGHT]
    marks = marks_of(recording)
    figure = require("matplotlib.figure").Figure(
        figsize=(WIDTH, HEAD_HEIGHT + sum(heights)), dpi=RESOLUTION, layout="constrained"
    )
    figure.get_layout_engine().set(h_pad=0.05, w_pad=0.08, hspace=0.02, wspace=0.02)
    figure.suptitle(headline(recording), x=0.012, ha="left", fontsize=11.0)
    heights[0] = max(heights[0], 0.01)
    upper, middle, lower = figure.subfigures(3, 1, height_ratios=heights)
    if rows:
        _draw_axes(upper, recording, columns, chosen, marks)
    draw_timeline(middle.subplots(), recording, marks, 2 * POINTS)
    _draw_timing(lower, recording)
    return figure


def choose(recording: Recording, axes: Sequence[str] | None) -> list[int]:
    """Return the numbers of the named axes.

    Args:
        recording: the recording.
        axes: names; None for all axes.

    Raises:
        RecordingError: An axis is unknown.
    """
    if axes is None:
        return list(range(len(recording.axes)))
    unknown = [name for name in axes if name not in recording.axes]
    if unknown:
        raise RecordingError(
            f"{recording.name} has no axis {', '.join(map(repr, unknown))}",
            hint=f"its axes are {', '.join(recording.axes)}",
        )
    return [recording.axes.index(name) for name in axes]


def checked_reference(recording: Recording, reference: str | None) -> str | None:
    """Return the reference field, or the default if it is None.

    Args:
        recording: the recording.
        reference: name of the field; None for the default.

    Raises:
        RecordingError: The recording has no such field with one number per axis.
    """
    if reference is None:
        return reference_of(recording)
    if not recording.layout.of_axes(reference):
        known = [field.name for field in recording.layout.fields]
        raise RecordingError(
            f"{recording.name} has no field {reference!r} with one number per axis",
            hint="such fields are "
            + ", ".join(name for name in known if recording.layout.of_axes(name)),
        )
    return reference


def make_columns(recording: Recording, reference: str | None, unit: str) -> list[Column]:
    """Return the columns for position, tracking error and torque, if they were recorded.

    Args:
        recording: the recording.
        reference: field to compare positions with; None to omit it.
        unit: unit of angles, "rad" or "deg".

    Raises:
        ValueError: The unit is unknown.
    """
    if unit not in ("rad", "deg"):
        raise ValueError(f"unit {unit!r} of angles must be 'rad' or 'deg'")
    length = recording.unit("position")
    if length in ("", "rad"):
        factor, name = (1.0, "rad") if unit == "rad" else (degrees(1.0), "°")
    else:
        factor, name = 1.0, length  # linear axes
    commanded = of_axes(recording, "commanded_torque")
    columns = (
        _column(
            "position",
            name,
            _line("reference", of_axes(recording, reference), REFERENCE, WIDE, factor),
            _line("actual", of_axes(recording, "position"), POSITION, NARROW, factor),
        ),
        _column(
            "tracking error",
            name,
            _line(
                "reference - actual", tracking_error(recording, reference), ERROR, NARROW, factor
            ),
        ),
        _column(
            "torque",
            recording.unit("torque") or "N·m",
            _line("commanded", commanded if was_commanded(commanded) else None, REFERENCE, WIDE),
            _line("actual", of_axes(recording, "torque"), TORQUE, NARROW),
        ),
    )
    return [column for column in columns if column.lines]


def was_commanded(values: Floats | None) -> bool:
    """Return True if a quantity was recorded and is not always zero."""
    return values is not None and bool(np.nan_to_num(values).any())


def _line(
    name: str, values: Floats | None, color: str, width: float, factor: float = 1.0
) -> Line | None:
    return None if values is None else Line(name, values * factor, color, width)


def _column(title: str, unit: str, *candidates: Line | None) -> Column:
    lines = [line for line in candidates if line is not None]
    if not lines:
        return Column(title, ())
    top = max((line.values for line in lines), key=lambda values: float(_top(values)))
    scale, prefix = (1.0, "") if unit == "°" else prefix_for(top)
    scaled = [Line(each.name, each.values / scale, each.color, each.width) for each in lines]
    return Column(f"{title} [{prefix}{unit}]", tuple(scaled))


def _top(values: Floats) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if len(finite) else 0.0


def headline(recording: Recording) -> str:
    """Return a two-line description of the recording."""
    seconds = float(np.ptp(recording.time)) if len(recording) else 0.0
    lost = f"{recording.lost} lost" if recording.lost else "none lost"
    count = len(recording.events)
    events = f", {count_of(count, 'event', 'events')}" if count else ""
    axes = count_of(len(recording.axes), "axis", "axes")
    return (
        f"{recording.name}: {axes} at {1.0 / recording.period:.6g} Hz\n"
        f"{len(recording)} cycles in {seconds:.3f} s, {lost}{events}; ended: {recording.ended}"
    )


def _draw_axes(
    part: Any, recording: Recording, columns: list[Column], chosen: list[int], marks: list[Mark]
) -> None:
    """Plot one row per axis and one column per quantity."""
    grid = part.subplots(len(chosen), len(columns), sharex=True, squeeze=False)
    points = POINTS if len(chosen) <= MANY else FEW_POINTS
    for place, column in enumerate(columns):
        drawn = [
            (line, thin(*with_gaps(recording, line.values[:, chosen]), points))
            for line in column.lines
        ]
        for row, plot in enumerate(grid[:, place]):
            for line, (time, values) in drawn:
                plot.plot(time, values[:, row], color=line.color, lw=line.width, label=line.name)
            draw_marks(plot, marks)
            plot.margins(x=0.01)
        _head(grid[0, place], column)
        grid[-1, place].set_xlabel("time [s]")
    for row, axis in enumerate(chosen):
        grid[row, 0].set_ylabel(
            recording.axes[axis], rotation=0, ha="right", va="center", color=INK, weight="bold",
            labelpad=10.0,
        )  # fmt: skip
    part.align_ylabels(grid[:, 0])
    for row in range(TIMES_EVERY - 1, len(chosen), TIMES_EVERY):
        for plot in grid[row]:
            plot.tick_params(axis="x", labelbottom=True)


def _head(plot: Any, column: Column) -> None:
    """Draw the title and the legend of a column."""
    plot.set_title(column.title, loc="left", fontsize=10.0)
    plot.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(column.lines), fontsize=8.0,
        borderaxespad=0.1, handlelength=1.6, columnspacing=1.2,
    )  # fmt: skip


def _draw_timing(part: Any, recording: Recording) -> None:
    """Plot histograms with logarithmic counts, so that a single late cycle is visible."""
    phases = ("period", "lateness", "in_controller")
    known = {phase: values for phase in phases for values in [timing_us(recording, phase)]}
    for plot, (phase, values) in zip(
        part.subplots(1, len(phases), squeeze=False)[0], known.items(), strict=True
    ):
        title = phase.replace("_", " ")
        if values is None:
            plot.set_axis_off()
            plot.set_title(f"{title}: not recorded", loc="left", fontsize=9.0, color=SOFT)
            continue
        low, median, high = np.quantile(values, (0.0005, 0.5, 0.9995))
        span = max(high - low, 1.0)
        edges = np.linspace(max(low - span / 2, 0.0), high + span / 2, 61)
        plot.hist(np.clip(values, edges[0], edges[-1]), bins=edges, color=BAR)
        plot.ticklabel_format(axis="x", useOffset=False)
        plot.set_yscale("log")
        plot.set_ylim(0.7, None)
        words = f"median {median:.1f}, p99 {np.quantile(values, 0.99):.1f}, max {values.max():.1f}"
        plot.set_title(f"{title}: {words}", loc="left", fontsize=9.0)
        beyond = int(np.count_nonzero(values > edges[-1]))
        note = f"; the last bar includes {beyond} larger values" if beyond else ""
        plot.set_xlabel(f"{title} [µs]{note}")
        plot.set_ylabel("cycles")

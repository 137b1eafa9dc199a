"""Reader of the CSV file of a log (`Log.to_csv`), which returns a recording."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary.errors import RecordingError
from catenary.record.layout import NUMBER, TIME, Field, Layout
from catenary.record.recording import Recording

SECONDS = "time"  # column with the time [s], as `cycle.time`
AXIS = ".actual.position"  # suffix of a column that every logged axis has
UNITS = {"position": "rad", "velocity": "rad/s", "torque": "N·m"}
HINT = "write the file with loop.log.to_csv(path); Loop(log_axes=True) adds the axes"
Columns = Mapping[str, npt.NDArray[Any]]


def read_csv(path: str | os.PathLike[str], *, start: float = 0.0, end: float = np.inf) -> Recording:
    """Read the CSV file of a log, or a part of it.

    Args:
        path: the file.
        start: start of the part [s], as `cycle.time`. 0 includes the cycles before the first
            iteration.
        end: end of the part [s], as `cycle.time`.

    Raises:
        RecordingError: The file is not the CSV file of a log, a line is damaged, or there are
            fewer than two cycles.
        OSError: The file cannot be read.
    """
    columns = _columns(Path(path))
    _check(path, columns)
    seconds = columns[SECONDS]
    part = (seconds >= (start if start > 0 else -math.inf)) & (seconds <= end)
    scheduled, number = columns[TIME], columns[NUMBER]
    axes = [name.removesuffix(AXIS) for name in columns if name.endswith(AXIS)]
    layout = Layout(
        name=Path(path).stem,
        period=float(np.median(np.diff(scheduled) / np.diff(number))) * 1e-9,
        axes=tuple(axes),
        fields=_fields(columns, axes),
    )
    return Recording(
        layout=layout,
        rows=_rows(layout, columns, part),
        events=(),
        lost=int(number[-1] - number[0]) + 1 - len(number),
        ended="end of the log",
        began_ns=int(scheduled[0]) - round(float(seconds[0]) * 1e9),
    )


def _columns(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the columns of the file by name."""
    with path.open(newline="") as file:
        try:
            head, *lines = csv.reader(file)
        except (ValueError, csv.Error) as error:
            raise RecordingError(f"{path} is not the CSV file of a log", hint=HINT) from error
    for number, line in enumerate(lines, 2):
        if len(line) != len(head):
            raise RecordingError(
                f"{path}, line {number}: {len(line)} values for {len(head)} columns", hint=HINT
            )
    return {name: _numbers(path, name, [*cells]) for name, *cells in zip(head, *lines, strict=True)}


def _numbers(path: Path, name: str, cells: Sequence[str]) -> npt.NDArray[Any]:
    """Return a column as integers if possible, otherwise as float64."""
    for kind in (int, float):
        try:
            return np.array([kind(cell) for cell in cells])
        except (ValueError, OverflowError):
            continue
    raise RecordingError(f"{path}: column {name!r} has values that are not numbers", hint=HINT)


def _check(path: str | os.PathLike[str], columns: Columns) -> None:
    missing = [name for name in (SECONDS, NUMBER, TIME) if name not in columns]
    if missing:
        raise RecordingError(
            f"{path} is not the CSV file of a log: it has no column {', '.join(missing)}",
            hint=HINT,
        )
    if len(columns[NUMBER]) < 2 or not (np.diff(columns[NUMBER]) > 0).all():
        raise RecordingError(f"{path} must have at least two cycles, in ascending order", hint=HINT)


def _fields(columns: Columns, axes: Sequence[str]) -> tuple[Field, ...]:
    """Return the fields of the cycle, followed by those of the axes."""
    of_axes = [f"{axis}." for axis in axes]
    own = [name for name in columns if not name.startswith(tuple(of_axes)) and name != SECONDS]
    fields = [Field(name, columns[name].dtype.str) for name in own]
    if axes:
        kinds = [name.removeprefix(of_axes[0]) for name in columns if name.startswith(of_axes[0])]
        fields += [
            Field(
                field_name(kind),
                columns[of_axes[0] + kind].dtype.str,
                (len(axes),),
                UNITS.get(kind.rpartition(".")[2], ""),
                per_axis=True,
            )
            for kind in kinds
        ]
    return tuple(fields)


def field_name(kind: str) -> str:
    """Return the name of the field for a column of an axis.

    Examples: actual.position → position, target.torque → target_torque.
    """
    return kind.removeprefix("actual.").replace(".", "_")


def _rows(layout: Layout, columns: Columns, part: npt.NDArray[np.bool_]) -> npt.NDArray[np.void]:
    rows = np.zeros(int(part.sum()), layout.dtype)
    names = {field.name for field in layout.fields if not field.per_axis}
    for name in names:
        rows[name] = columns[name][part]
    for number, axis in enumerate(layout.axes):
        for name, values in columns.items():
            if name.startswith(f"{axis}."):
                rows[field_name(name.removeprefix(f"{axis}."))][:, number] = values[part]
    return rows

"""Rows that combine several blocks, since a law has one memory and one row of parameters."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row, compiles

PerAxis = float | Sequence[float] | npt.NDArray[np.float64]
"""One value for all axes, or one per axis."""

Settings = TypeVar("Settings")


def join(*parts: Sequence[float] | Row) -> Row:
    """Join several rows into one. `part(row, k)` returns row k again. A row may be empty."""
    rows = [np.asarray(part, dtype=np.float64).ravel() for part in parts]
    first = len(rows) + 2  # count, start of each part, end
    begins = first + np.cumsum([0, *map(len, rows)])
    return np.concatenate([[len(rows)], begins, *rows]).astype(np.float64)


@compiles
def part(row: Row, k: int) -> Row:
    """Return a part of a row that `join` made, as a view.

    Args:
        row: result of `join`.
        k: number of the part, from 0.

    Raises:
        IndexError: The row has no part `k`.
    """
    if k < 0 or k >= row[0]:
        raise IndexError("the row has no part with this number; see control.join")
    return row[int(row[1 + k]) : int(row[2 + k])]


def every(step: Callable[..., float], rows: Sequence[Row], *inputs: PerAxis) -> Row:
    """Compute one step of all axes in plain Python.

        torque = every(cascade, (memory, parameters), goal, 0.0, gravity, position, velocity, dt)

    Args:
        step: step function of a block, called as `step(*rows, i, *inputs)`.
        rows: memory and parameters of the block, or only its parameters if it has no memory.
        *inputs: each one number for all axes, or (n,). At least one has the shape (n,).

    Returns:
        Output of each axis (n,).

    Raises:
        ValueError: The shapes of the inputs do not match, or every input is a single number.
    """
    columns = np.broadcast_arrays(*(np.asarray(each, dtype=np.float64) for each in inputs))
    if not columns or columns[0].ndim != 1:
        raise ValueError("every: give at least one input with one number per axis, shape (n,)")
    values = zip(*(column.tolist() for column in columns), strict=True)
    return np.array([step(*rows, i, *axis) for i, axis in enumerate(values)])


@compiles
def restart(memory: Row, i: int, n: int) -> None:
    """Reset the state of one axis. Use it while the axis is not enabled.

    Integrators become zero. Filters start again from their next input.

    Args:
        memory: memory of one block.
        i: number of the axis.
        n: number of axes of the block.
    """
    width = len(memory) // n
    for k in range(i * width, (i + 1) * width):
        memory[k] = 0.0


def checked(name: str, value: PerAxis, n: int, *, least: float = 0.0, above: bool = False) -> Row:
    """Return an option as one number per axis, after a check of its range.

    Args:
        name: name of the option, for messages.
        value: one number for all axes, or one per axis.
        n: number of axes.
        least: smallest valid value.
        above: True if `least` itself is invalid.

    Returns:
        Values (n,).

    Raises:
        ValueError: The number of values is wrong, or a value is NaN or too small.
    """
    row = np.array(value, dtype=np.float64)
    if row.ndim > 1 or row.size not in (1, n):
        raise ValueError(
            f"{name} has shape {row.shape}; give one value, or one for each of {n} axes"
        )
    row = np.array(np.broadcast_to(row, (n,)))
    for i, number in enumerate(row.tolist()):
        if not (number > least if above else number >= least):
            bound = "above" if above else "at least"
            raise ValueError(f"{name} of axis {i} is {number}; it must be {bound} {least}")
    return row


def computed_once(make: Callable[[Settings], Row]) -> Callable[[Settings], Row]:
    """Compute a row of settings once, and return a copy of it in each call.

    A program may then read the row of parameters in each cycle. Settings do not change.

    Args:
        make: method that computes the row.
    """
    name = f"_{make.__name__}"

    @functools.wraps(make)
    def row(self: Settings) -> Row:
        kept: dict[str, Row] = self.__dict__  # a frozen dataclass has no other place
        if name not in kept:
            kept[name] = make(self)
        return kept[name].copy()

    return row


def axis_count(axes: int) -> int:
    """Return `axes`. Raises ValueError if it is less than 1."""
    if axes < 1:
        raise ValueError(f"axes={axes}; at least one axis is needed")
    return axes


def table(kind: float, *columns: Row) -> Row:
    """Return the parameters of a block: its kind, then the values of each axis in turn."""
    return np.concatenate([[kind], np.column_stack(columns).ravel()])

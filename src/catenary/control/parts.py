"""Rows of numbers of several blocks in one: a law has one memory and one row of parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row, compiles

PerAxis = float | Sequence[float] | npt.NDArray[np.float64]
"""One value for all axes, or one for each."""


def join(*parts: Sequence[float] | Row) -> Row:
    """Join several rows into one; `part(row, k)` returns part k. Parts may be empty."""
    rows = [np.asarray(part, dtype=np.float64).ravel() for part in parts]
    first = len(rows) + 2  # count, where each begins, the end
    begins = first + np.cumsum([0, *map(len, rows)])
    return np.concatenate([[len(rows)], begins, *rows]).astype(np.float64)


@compiles
def part(row: Row, k: int) -> Row:
    """Return part `k` of a row made by `join`: a view, also in a law."""
    if k < 0 or k >= row[0]:
        raise IndexError("the row has no such part: see control.join")
    return row[int(row[1 + k]) : int(row[2 + k])]


def every(step: Callable[..., float], rows: Sequence[Row], *inputs: PerAxis) -> Row:
    """(n,) one step of all axes, in plain Python: what `step(*rows, i, ...)` says for each.

        torque = every(cascade, (memory, parameters), goal, 0.0, gravity, position, velocity, dt)

    `rows`: the block's memory and parameters, or its parameters where it has no memory. `inputs`:
    one number for all axes, or (n,). ValueError: they do not fit each other, or none has n.
    """
    columns = np.broadcast_arrays(*(np.asarray(each, dtype=np.float64) for each in inputs))
    if not columns or columns[0].ndim != 1:
        raise ValueError("every: at least one of the inputs has a number for each axis, (n,)")
    values = zip(*(column.tolist() for column in columns), strict=True)
    return np.array([step(*rows, i, *axis) for i, axis in enumerate(values)])


@compiles
def restart(memory: Row, i: int, n: int) -> None:
    """Reset a block for axis `i` of `n`: integrators are empty, filters start at their next input.

    `memory` is the block's own. An axis that is not enabled is reset in this way.
    """
    width = len(memory) // n
    for k in range(i * width, (i + 1) * width):
        memory[k] = 0.0


def checked(name: str, value: PerAxis, n: int, *, least: float = 0.0, above: bool = False) -> Row:
    """(n,) one number for each axis. ValueError names the option and the axis: another number of
    them, NaN, or below `least` (`above`: or equal)."""
    row = np.array(value, dtype=np.float64)
    if row.ndim > 1 or row.size not in (1, n):
        raise ValueError(f"{name}: one value, or one for each of {n} axes, not {row.shape}")
    row = np.array(np.broadcast_to(row, (n,)))
    for i, number in enumerate(row.tolist()):
        if not (number > least if above else number >= least):
            bound = "above" if above else "at least"
            raise ValueError(f"{name} of axis {i}: {number}, must be {bound} {least}")
    return row


def axis_count(axes: int) -> int:
    if axes < 1:
        raise ValueError(f"axes={axes}: at least one")
    return axes


def table(kind: float, *columns: Row) -> Row:
    """Return a block's parameters: its kind, then one line of numbers for each axis."""
    return np.concatenate([[kind], np.column_stack(columns).ravel()])

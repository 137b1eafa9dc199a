"""From rows to what is drawn: thinned lines, timing in microseconds, figures of merit."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from catenary.record.layout import NUMBER
from catenary.record.recording import Recording

UNKNOWN_BELOW = 0.0  # a cycle that does not know a phase has -1 ns
Floats = npt.NDArray[np.float64]
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def of_axes(recording: Recording, field: str) -> Floats | None:
    """A field with a value for each axis, (cycles, axes); None where it was not recorded."""
    if not recording.layout.of_axes(field):
        return None
    return np.asarray(recording[field], np.float64)


def tracking_error(recording: Recording, reference: str = "commanded_position") -> Floats | None:
    """Reference minus actual position, (cycles, axes) [rad]; None where one was not recorded."""
    wanted, actual = of_axes(recording, reference), of_axes(recording, "position")
    return None if wanted is None or actual is None else wanted - actual


def rms(values: Floats) -> Floats:
    """Of each column."""
    return np.asarray(np.sqrt(np.nanmean(np.square(values), axis=0)))


def largest(values: Floats) -> Floats:
    """The largest magnitude in each column."""
    return np.asarray(np.nanmax(np.abs(values), axis=0))


def timing_us(recording: Recording, phase: str) -> Floats | None:
    """A phase of every cycle where it is known [us]; in_controller is the sum of three."""
    names = ("receive", "process", "send") if phase == "in_controller" else (phase,)
    if any(recording.layout.field(f"{name}_ns") is None for name in names):
        return None
    parts = np.array([recording[f"{name}_ns"] for name in names], np.float64)
    known = parts.sum(axis=0)[(parts >= UNKNOWN_BELOW).all(axis=0)]
    return known * 1e-3 if len(known) else None


def with_gaps(recording: Recording, values: Floats) -> tuple[Floats, Floats]:
    """Time and values with a NaN where cycles were lost, so that no line is drawn across."""
    numbers = recording[NUMBER].astype(np.int64)
    lost = np.flatnonzero(np.diff(numbers) > 1) + 1
    return np.insert(recording.time, lost, np.nan), np.insert(values, lost, np.nan, axis=0)


def thin(time: Floats, values: Floats, most: int) -> tuple[Floats, Floats]:
    """At most 2·most points of each column that draw as all would: the least and the greatest of
    equal parts."""
    if len(time) <= 2 * most:
        return time, values
    starts = np.linspace(0, len(time), most, endpoint=False).astype(np.intp)
    low = np.minimum.reduceat(values, starts, axis=0)
    high = np.maximum.reduceat(values, starts, axis=0)
    both = np.stack([low, high], axis=1).reshape(2 * most, *values.shape[1:])
    return np.repeat(np.fmin.reduceat(time, starts), 2), both


def prefix_for(values: Floats) -> tuple[float, str]:
    """The unit's prefix with which the largest value has digits before the point."""
    finite = np.abs(values[np.isfinite(values)])
    top = float(finite.max()) if len(finite) else 0.0
    if top == 0.0:
        return PREFIXES[0]
    return next((each for each in PREFIXES if top >= each[0]), PREFIXES[-1])


def count_of(count: int, one: str, many: str) -> str:
    return f"{count} {one if count == 1 else many}"

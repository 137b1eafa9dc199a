"""Series for plots, computed from rows: thinned lines, timing in microseconds, figures of merit."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from catenary.record.layout import NUMBER
from catenary.record.recording import Recording

CSP = 8  # mode of operation, IEC 61800-7-201 §7.2: cyclic synchronous position
UNKNOWN_BELOW = 0.0  # a cycle that does not know a phase has -1 ns
Floats = npt.NDArray[np.float64]
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def of_axes(recording: Recording, field: str | None) -> Floats | None:
    """Return a field with a value for each axis, (cycles, axes); None if not recorded."""
    if field is None or not recording.layout.of_axes(field):
        return None
    return np.asarray(recording[field], np.float64)


def reference_of(recording: Recording) -> str | None:
    """Return the field to compare positions with: the commanded positions, if any drive is in CSP.

    In other modes only the application knows the reference.
    """
    sent = recording.layout.of_axes("commanded_position")
    followed = recording.layout.field("mode") is None or (recording["mode"] == CSP).any()
    return "commanded_position" if sent and followed else None


def tracking_error(recording: Recording, reference: str | None) -> Floats | None:
    """Return reference minus actual position, (cycles, axes) [rad]; None if one is missing."""
    actual = of_axes(recording, "position")
    wanted = of_axes(recording, reference)
    return None if wanted is None or actual is None else wanted - actual


def rms(values: Floats) -> Floats:
    """Return the RMS of the known values of each column."""
    known = np.isfinite(values)
    count = np.maximum(known.sum(axis=0), 1)
    return np.asarray(np.sqrt(np.square(values).sum(axis=0, where=known) / count))


def largest(values: Floats) -> Floats:
    """Return the largest magnitude of the known values of each column."""
    return np.asarray(np.abs(values).max(axis=0, where=np.isfinite(values), initial=0.0))


def phase_us(recording: Recording, phase: str) -> Floats | None:
    """Return a phase of every cycle [us], NaN where unknown; None if it was not recorded.

    `in_controller` is the sum of three phases.
    """
    names = ("receive", "process", "send") if phase == "in_controller" else (phase,)
    if any(recording.layout.field(f"{name}_ns") is None for name in names):
        return None
    parts = np.array([recording[f"{name}_ns"] for name in names], np.float64)
    known = (parts >= UNKNOWN_BELOW).all(axis=0)
    return np.where(known, parts.sum(axis=0) * 1e-3, np.nan)


def timing_us(recording: Recording, phase: str) -> Floats | None:
    """Return the known values of a phase [us]; None if there are none."""
    values = phase_us(recording, phase)
    if values is None or not np.isfinite(values).any():
        return None
    return values[np.isfinite(values)]


def with_gaps(recording: Recording, values: Floats) -> tuple[Floats, Floats]:
    """Return time and values with a NaN where cycles were lost, so that lines are interrupted."""
    numbers = recording[NUMBER].astype(np.int64)
    lost = np.flatnonzero(np.diff(numbers) > 1) + 1
    return np.insert(recording.time, lost, np.nan), np.insert(values, lost, np.nan, axis=0)


def thin(time: Floats, values: Floats, most: int) -> tuple[Floats, Floats]:
    """Return at most 2·most points of each column: minimum and maximum of equal parts.

    They look the same as all points.
    """
    if len(time) <= 2 * most:
        return time, values
    starts = np.linspace(0, len(time), most, endpoint=False).astype(np.intp)
    low = np.minimum.reduceat(values, starts, axis=0)
    high = np.maximum.reduceat(values, starts, axis=0)
    both = np.stack([low, high], axis=1).reshape(2 * most, *values.shape[1:])
    return np.repeat(np.fmin.reduceat(time, starts), 2), both


def peaks(time: Floats, values: Floats, most: int) -> tuple[Floats, Floats]:
    """Return at most `most` points: the maximum of the known values of equal parts."""
    starts = np.linspace(0, len(time), min(most, len(time)), endpoint=False).astype(np.intp)
    return time[starts], np.fmax.reduceat(values, starts)


def prefix_for(values: Floats) -> tuple[float, str]:
    """Return the prefix with which the largest value is 0.1 or more: 0.7 rad stay radians."""
    finite = np.abs(values[np.isfinite(values)])
    top = float(finite.max()) if len(finite) else 0.0
    if top == 0.0:
        return PREFIXES[0]
    return next((each for each in PREFIXES if top >= 0.1 * each[0]), PREFIXES[-1])


def count_of(count: int, one: str, many: str) -> str:
    return f"{count} {one if count == 1 else many}"

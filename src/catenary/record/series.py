"""Series for plots: thinned lines, timing in microseconds, RMS and maximum values."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from catenary.record.layout import NUMBER
from catenary.record.recording import Recording

CSP = 8  # mode of operation "cyclic synchronous position", IEC 61800-7-201 §7.2
UNKNOWN_BELOW = 0.0  # an unknown phase is recorded as -1 ns
Floats = npt.NDArray[np.float64]
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


def of_axes(recording: Recording, field: str | None) -> Floats | None:
    """Return a field with shape (cycles, axes); None if it was not recorded per axis.

    Args:
        recording: the recording.
        field: name of the field; None results in None.
    """
    if field is None or not recording.layout.of_axes(field):
        return None
    return np.asarray(recording[field], np.float64)


def reference_of(recording: Recording) -> str | None:
    """Return the field to compare positions with; None if it is unknown.

    If any drive is in CSP, or if the modes were not recorded, this is the commanded position. In
    other modes, only the application knows the reference.
    """
    sent = recording.layout.of_axes("commanded_position")
    in_csp = recording.layout.field("mode") is None or (recording["mode"] == CSP).any()
    return "commanded_position" if sent and in_csp else None


def tracking_error(recording: Recording, reference: str | None) -> Floats | None:
    """Return reference minus actual position, shape (cycles, axes); None if one is missing.

    The unit is that of the position.

    Args:
        recording: the recording.
        reference: name of the reference field, or None.
    """
    actual = of_axes(recording, "position")
    target = of_axes(recording, reference)
    return None if target is None or actual is None else target - actual


def rms(values: Floats) -> Floats:
    """Return the RMS of each column, ignoring NaN and infinities; 0 if nothing is left."""
    known = np.isfinite(values)
    count = np.maximum(known.sum(axis=0), 1)
    return np.asarray(np.sqrt(np.square(values).sum(axis=0, where=known) / count))


def largest(values: Floats) -> Floats:
    """Return the largest magnitude of each column, ignoring NaN and infinity; 0 if none is left."""
    return np.asarray(np.abs(values).max(axis=0, where=np.isfinite(values), initial=0.0))


def phase_us(recording: Recording, phase: str) -> Floats | None:
    """Return the duration of a phase in every cycle [us]; None if it was not recorded.

    Args:
        recording: the recording.
        phase: name of the phase; "in_controller" is the sum of receive, process and send.

    Returns:
        Durations (cycles,), NaN where unknown.
    """
    names = ("receive", "process", "send") if phase == "in_controller" else (phase,)
    if any(recording.layout.field(f"{name}_ns") is None for name in names):
        return None
    parts = np.array([recording[f"{name}_ns"] for name in names], np.float64)
    known = (parts >= UNKNOWN_BELOW).all(axis=0)
    return np.where(known, parts.sum(axis=0) * 1e-3, np.nan)


def timing_us(recording: Recording, phase: str) -> Floats | None:
    """Return the known durations of a phase [us]; None if no cycle has one.

    Args:
        recording: the recording.
        phase: name of the phase, as for `phase_us`.
    """
    values = phase_us(recording, phase)
    if values is None or not np.isfinite(values).any():
        return None
    return values[np.isfinite(values)]


def with_gaps(recording: Recording, values: Floats) -> tuple[Floats, Floats]:
    """Return time and values with a NaN in each gap of lost cycles, which interrupts the line.

    Args:
        recording: the recording.
        values: one row per cycle.
    """
    numbers = recording[NUMBER].astype(np.int64)
    lost = np.flatnonzero(np.diff(numbers) > 1) + 1
    return np.insert(recording.time, lost, np.nan), np.insert(values, lost, np.nan, axis=0)


def thin(time: Floats, values: Floats, most: int) -> tuple[Floats, Floats]:
    """Reduce lines to the minimum and maximum of each of `most` equal parts.

    The reduced lines look the same in a plot.

    Args:
        time: (points,).
        values: (points, lines).
        most: number of parts.

    Returns:
        Time and values of at most 2 · `most` points.
    """
    if len(time) <= 2 * most:
        return time, values
    starts = np.linspace(0, len(time), most, endpoint=False).astype(np.intp)
    low = np.minimum.reduceat(values, starts, axis=0)
    high = np.maximum.reduceat(values, starts, axis=0)
    both = np.stack([low, high], axis=1).reshape(2 * most, *values.shape[1:])
    return np.repeat(np.fmin.reduceat(time, starts), 2), both


def peaks(time: Floats, values: Floats, most: int) -> tuple[Floats, Floats]:
    """Reduce a line to the maximum of equal parts, without NaN.

    Args:
        time: (points,).
        values: (points,).
        most: number of parts.

    Returns:
        Time and value of at most `most` points.
    """
    starts = np.linspace(0, len(time), min(most, len(time)), endpoint=False).astype(np.intp)
    return time[starts], np.fmax.reduceat(values, starts)


def prefix_for(values: Floats) -> tuple[float, str]:
    """Return factor and symbol of the SI prefix with which the largest value is at least 0.1."""
    finite = np.abs(values[np.isfinite(values)])
    top = float(finite.max()) if len(finite) else 0.0
    if top == 0.0:
        return PREFIXES[0]
    return next((each for each in PREFIXES if top >= 0.1 * each[0]), PREFIXES[-1])


def count_of(count: int, one: str, many: str) -> str:
    """Return a number with its noun, in the singular or plural."""
    return f"{count} {one if count == 1 else many}"

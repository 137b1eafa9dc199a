"""Figures for the tuning of one axis, from its values while it moves.

The motion comes from a jog, from the program, or from a law with a chirp. Position is compared with
the commanded position. All numbers are SI.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from catenary.control.identification import frequency_response

ROWS_MIN = 200
SMOOTHING = 0.01  # [s], half width of the window of the derivative
RELIABLE = 0.8  # coherence
MOVING = 0.01  # part of the largest velocity below which the sign of the friction is unknown

Row = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Capture:
    """Values of one axis in consecutive cycles, each (rows,)."""

    period: float  # [s]
    position: Row
    commanded: Row
    velocity: Row
    torque: Row


@dataclass(frozen=True, slots=True)
class Bode:
    """Frequency response from the commanded to the measured position, and the margins.

    The margins are those of the open loop L = T / (1 - T). None: L does not cross the line within
    the reliable frequencies.
    """

    frequency: Row  # [Hz], only where the coherence is reliable
    magnitude_db: Row
    phase_deg: Row
    coherence: Row
    gain_margin_db: float | None
    phase_margin_deg: float | None
    crossover: float | None  # of the open loop [Hz]
    bandwidth: float | None  # at which the magnitude falls below -3 dB [Hz]


@dataclass(frozen=True, slots=True)
class Identified:
    """Result of the regression torque = J·acceleration + B·velocity + C·sign(velocity) + offset."""

    inertia: float  # [kg·m²] or [kg]
    viscous: float  # [N·m·s/rad] or [N·s/m]
    coulomb: float  # [N·m] or [N]
    offset: float  # [N·m] or [N], for example gravity
    errors: tuple[float, ...]  # standard errors of these four numbers
    determination: float  # R², 1: the model explains the torque completely


def bode(capture: Capture) -> Bode:
    """Return the frequency response of the position.

    Raises:
        ValueError: The capture is too short, or the axis did not move.
    """
    check(capture)
    found = frequency_response(capture.commanded, capture.position, capture.period)
    good = (found.coherence >= RELIABLE) & np.isfinite(found.response)
    if good.sum() < 3:
        raise ValueError("the motion is too small or too slow for a frequency response")
    frequency, closed = found.frequency[good], found.response[good]
    with np.errstate(divide="ignore", invalid="ignore"):
        opened = closed / (1.0 - closed)
    level = 20 * np.log10(abs(closed))
    gain, phase, crossover = margins(frequency, opened)
    return Bode(
        frequency=frequency,
        magnitude_db=level,
        phase_deg=np.degrees(np.unwrap(np.angle(closed))),
        coherence=found.coherence[good],
        gain_margin_db=gain,
        phase_margin_deg=phase,
        crossover=crossover,
        bandwidth=crossing(frequency, level + 3.0),
    )


def margins(
    frequency: Row, opened: npt.NDArray[np.complex128]
) -> tuple[float | None, float | None, float | None]:
    """Return the gain margin [dB], the phase margin [degrees] and the crossover [Hz].

    Args:
        frequency: (k,) [Hz].
        opened: response of the open loop, (k,).
    """
    level = 20 * np.log10(np.maximum(abs(opened), 1e-12))
    phase = np.degrees(np.unwrap(np.angle(opened)))
    phase -= 360.0 * np.round((phase[0] + 90.0) / 360.0)  # an integrator starts near -90 degrees
    gain_at, phase_at = crossing(frequency, phase + 180.0), crossing(frequency, level)
    gain = None if gain_at is None else -float(np.interp(gain_at, frequency, level))
    if phase_at is None:
        return gain, None, None
    return gain, 180.0 + float(np.interp(phase_at, frequency, phase)), phase_at


def crossing(frequency: Row, values: Row) -> float | None:
    """Return the first frequency at which `values` fall through 0 [Hz]; None without one.

    Args:
        frequency: (k,) [Hz].
        values: (k,).
    """
    falls = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
    if not len(falls):
        return None
    n = falls[0]
    share = values[n] / (values[n] - values[n + 1])
    return float(frequency[n] + share * (frequency[n + 1] - frequency[n]))


def identify(capture: Capture) -> Identified:
    """Estimate inertia and friction by linear regression.

    Source: Farhat et al., Dynamic parameter identification of parallel robots, 2008, for one axis.

    Raises:
        ValueError: The capture is too short, or the axis did not move.
    """
    check(capture)
    half = max(round(SMOOTHING / capture.period), 1)
    acceleration = smooth_derivative(capture.velocity, half, capture.period)
    velocity, torque = (each[half:-half] for each in (capture.velocity, capture.torque))
    used = abs(velocity) > MOVING * abs(velocity).max()
    columns = (acceleration, velocity, np.sign(velocity), np.ones(len(velocity)))
    model, measured = np.stack(columns, axis=1)[used], torque[used]
    if len(measured) < ROWS_MIN or np.linalg.matrix_rank(model) < model.shape[1]:
        raise ValueError("the motion is too uniform; move the axis in both directions")
    numbers, *_ = np.linalg.lstsq(model, measured, rcond=None)
    rest = measured - model @ numbers
    variance = float(rest @ rest) / (len(measured) - len(numbers))
    errors = np.sqrt(variance * np.diag(np.linalg.inv(model.T @ model))).tolist()
    spread = float(np.sum((measured - measured.mean()) ** 2))
    explained = 1.0 - float(rest @ rest) / spread if spread else 0.0
    inertia, viscous, coulomb, offset = numbers.tolist()
    return Identified(inertia, viscous, coulomb, offset, tuple(errors), explained)


def smooth_derivative(values: Row, half: int, period: float) -> Row:
    """Return the slope of a line through 2 · `half` + 1 values, (rows - 2 · half,).

    Args:
        values: (rows,).
        half: half width of the window.
        period: time between two values [s].
    """
    weights = np.arange(-half, half + 1, dtype=np.float64)
    slope = np.correlate(values, weights, "valid") / (weights @ weights * period)
    return np.asarray(slope, np.float64)


def check(capture: Capture) -> None:
    """Raise ValueError if a capture is too short, or without motion."""
    if len(capture.position) < ROWS_MIN:
        raise ValueError(f"{len(capture.position)} cycles are too few; capture {ROWS_MIN} or more")
    rows = (capture.position, capture.commanded, capture.velocity, capture.torque)
    if not all(np.isfinite(row).all() for row in rows):
        raise ValueError("a value of the axis is not known in every cycle")
    if not np.ptp(capture.position) > 0:
        raise ValueError("the axis did not move")

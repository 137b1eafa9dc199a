"""Trajectories with limited velocity, acceleration and jerk, computed by ruckig."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row
from catenary.control.parts import PerAxis, checked
from catenary.errors import ConfigurationError

Rows = npt.NDArray[np.float64]
Vector = Sequence[float] | Row

SLACK = 1e-9  # relative tolerance of a limit, for rounding errors


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of a motion; each is one value, or one per axis.

    The units are rad/s, rad/s², rad/s³, and rad for the positions.
    """

    velocity: PerAxis
    acceleration: PerAxis
    jerk: PerAxis
    position_min: PerAxis = -math.inf
    position_max: PerAxis = math.inf


@dataclass(frozen=True, slots=True)
class MotionState:
    """Initial state of a motion: position [rad], velocity [rad/s], acceleration [rad/s²].

    Each has the shape (n,). An acceleration of None means zero.
    """

    position: Vector
    velocity: Vector
    acceleration: Vector | None = None


class Trajectory:
    """Motion with one row per period. The last row is the goal, at rest.

    `duration` is the time of the motion [s]. The motion ends within the last period.

    The first access to `position`, `velocity` or `acceleration` computes all rows. Each row takes
    a few microseconds. A task with a deadline calls `row` to compute one row at a time.
    """

    def __init__(self, pieces: Sequence[Any], goal: Row, period: float) -> None:
        self._pieces, self._goal, self._period = pieces, goal, period
        self._ends = np.cumsum([piece.duration for piece in pieces]).tolist()
        self.duration = float(self._ends[-1])
        self._count = max(1, math.ceil(self.duration / period - SLACK))

    def __len__(self) -> int:
        return self._count

    def row(self, number: int) -> Rows:
        """Return position, velocity and acceleration of one row, shape (3, n).

        Args:
            number: number of the row, from 0.

        Raises:
            IndexError: The trajectory has no such row.
        """
        if not 0 <= number < self._count:
            raise IndexError(f"row {number} is outside the trajectory of {self._count} rows")
        if number == self._count - 1:
            rest = np.zeros(len(self._goal))
            return np.stack([self._goal, rest, rest])
        now = (number + 1) * self._period
        which = bisect_left(self._ends, now)
        piece = self._pieces[which]
        return np.array(piece.at_time(now - (self._ends[which] - piece.duration))[:3])

    @property
    def time(self) -> Row:
        """Time of each row since the start [s], shape (k,). The first row is at one period."""
        return self._period * np.arange(1, self._count + 1, dtype=np.float64)

    @property
    def position(self) -> Rows:
        """Positions [rad], shape (k, n)."""
        return self._rows[:, 0]

    @property
    def velocity(self) -> Rows:
        """Velocities [rad/s], shape (k, n)."""
        return self._rows[:, 1]

    @property
    def acceleration(self) -> Rows:
        """Accelerations [rad/s²], shape (k, n)."""
        return self._rows[:, 2]

    @cached_property
    def _rows(self) -> Rows:
        return np.stack([self.row(number) for number in range(self._count)])


def trajectory(
    start: Vector | MotionState,
    goal: Vector | Sequence[Vector],
    limits: MotionLimits,
    period: float,
) -> Trajectory:
    """Return the fastest motion to rest at `goal`. All axes arrive together.

    This function needs ruckig: pip install 'catenary[traj]'.

    Args:
        start: positions (n,) [rad] of axes at rest, or a `MotionState`.
        goal: positions (n,) [rad]. Several goals (m, n) are reached in turn. The motion comes to
            rest at each.
        limits: limits of the motion.
        period: time between two rows [s].

    Returns:
        Motion from the start to the last goal.

    Raises:
        ValueError: The start or a goal is outside the limits, the axes cannot stop within them, an
            argument is not valid, or ruckig finds no motion.
        ConfigurationError: ruckig is not installed.

    Source: Berscheid and Kröger, Jerk-limited real-time trajectory generation with arbitrary target
    states, RSS 2021.
    """
    if not period > 0 or math.isinf(period):
        raise ValueError(f"period={period} s must be positive and finite")
    ruckig = _ruckig()
    first = start if isinstance(start, MotionState) else MotionState(start, np.zeros(len(start)))
    q, v, a = _begin(first)
    bounds = _Bounds.of(limits, len(q))
    bounds.check_start(q, v, a)
    goals = np.array(goal, dtype=np.float64)
    goals = goals[None] if goals.ndim == 1 else goals
    if goals.ndim != 2 or goals.shape[1] != len(q) or not len(goals):
        raise ValueError(
            f"goal has shape {goals.shape}; give {len(q)} numbers, or rows of {len(q)} numbers"
        )
    for row in goals:
        bounds.check_goal(row)
    rest = np.zeros(len(q))
    stages = [(q, v, a), *((row, rest, rest) for row in goals)]
    pieces = [_piece(ruckig, begin, end[0], bounds) for begin, end in pairwise(stages)]
    return Trajectory(pieces, goals[-1], period)


@dataclass(frozen=True, slots=True)
class _Bounds:
    """Checked limits of a motion, one value per axis."""

    velocity: Row
    acceleration: Row
    jerk: Row
    position_min: Row
    position_max: Row

    @classmethod
    def of(cls, limits: MotionLimits, n: int) -> _Bounds:
        """Return the limits of `n` axes. Raises ValueError if a limit is not valid."""
        rates = [
            checked(name, getattr(limits, name), n, above=True)
            for name in ("velocity", "acceleration", "jerk")
        ]
        for name, row in zip(("velocity", "acceleration", "jerk"), rates, strict=True):
            _raise_first(name, row, np.isinf(row), "must be finite")
        low, high = (
            checked(name, getattr(limits, name), n, least=-math.inf)
            for name in ("position_min", "position_max")
        )
        _raise_first("position_min", low, low >= high, "must be below position_max")
        velocity, acceleration, jerk = rates
        return cls(velocity, acceleration, jerk, low, high)

    def check_start(self, q: Row, v: Row, a: Row) -> None:
        """Raise ValueError if no motion within the limits can start from this state."""
        self._check_position("start", q)
        _raise_first("start velocity", v, abs(v) > self.velocity * (1 + SLACK), self.velocity)
        most = self.acceleration
        _raise_first("start acceleration", a, abs(a) > most * (1 + SLACK), most)
        # The velocity still changes while the acceleration decreases to zero: v + a |a| / (2 j).
        ahead = v + a * abs(a) / (2 * self.jerk)
        what = "velocity after the start acceleration has decreased to zero"
        _raise_first(what, ahead, abs(ahead) > self.velocity * (1 + SLACK), self.velocity)

    def check_goal(self, q: Row) -> None:
        """Raise ValueError if a goal is not finite or exceeds a position limit."""
        _raise_first("goal", q, ~np.isfinite(q), "must be finite")
        self._check_position("goal", q)

    def check_path(self, lowest: Row, highest: Row) -> None:
        """Check the range of a motion against the position limits.

        Args:
            lowest: Lowest position of each axis during the motion.
            highest: Highest position of each axis during the motion.

        Raises:
            ValueError: The motion exceeds a position limit.
        """
        self._check_position("lowest position of the motion", lowest)
        self._check_position("highest position of the motion", highest)

    def _check_position(self, what: str, q: Row) -> None:
        for name, row, sign in (
            ("position_min", self.position_min, -1.0),
            ("position_max", self.position_max, 1.0),
        ):
            beyond = sign * (q - row) > SLACK * np.maximum(1.0, abs(np.nan_to_num(row)))
            _raise_first(what, q, beyond, row, name)


def _raise_first(what: str, row: Row, wrong: npt.NDArray[np.bool_], *why: object) -> None:
    """Raise ValueError for the first axis with an invalid value."""
    for i in np.flatnonzero(wrong).tolist():
        limit, name = why[0], why[1] if len(why) > 1 else "the limit"
        reason = limit if isinstance(limit, str) else f"is beyond {name} {np.asarray(limit)[i]:g}"
        raise ValueError(f"{what} of axis {i} is {row[i]:g}; it {reason}")


def _begin(state: MotionState) -> tuple[Row, Row, Row]:
    q = np.array(state.position, dtype=np.float64)
    if q.ndim != 1 or not q.size:
        raise ValueError(f"start has shape {q.shape}; give one number per axis")
    rows = [q]
    for name in ("velocity", "acceleration"):
        given = getattr(state, name)
        row = np.zeros(len(q)) if given is None else np.array(given, dtype=np.float64)
        if row.shape != q.shape:
            raise ValueError(f"start {name} has shape {row.shape}; give {len(q)} numbers")
        rows.append(row)
    for name, row in zip(("position", "velocity", "acceleration"), rows, strict=True):
        _raise_first(f"start {name}", row, ~np.isfinite(row), "must be finite")
    return rows[0], rows[1], rows[2]


def _ruckig() -> Any:
    try:
        return import_module("ruckig")
    except ImportError as error:
        raise ConfigurationError(
            "ruckig, which computes trajectories, is not installed",
            hint="pip install 'catenary[traj]'",
        ) from error


def _piece(ruckig: Any, begin: tuple[Row, Row, Row], goal: Row, bounds: _Bounds) -> Any:
    """Return ruckig's trajectory from one state to rest."""
    n = len(goal)
    task = ruckig.InputParameter(n)
    q, v, a = begin
    task.current_position, task.current_velocity = q.tolist(), v.tolist()
    task.current_acceleration = a.tolist()
    task.target_position = goal.tolist()
    task.max_velocity = bounds.velocity.tolist()
    task.max_acceleration = bounds.acceleration.tolist()
    task.max_jerk = bounds.jerk.tolist()
    piece = ruckig.Trajectory(n)
    result = ruckig.Ruckig(n).calculate(task, piece)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ValueError(f"cannot compute a motion from {q} to {goal}: ruckig returned {result}")
    extremes = piece.position_extrema
    bounds.check_path(
        np.array([axis.min for axis in extremes]), np.array([axis.max for axis in extremes])
    )
    return piece

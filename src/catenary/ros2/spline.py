"""Splines through waypoints, piecewise linear, cubic or quintic, with exact extremes."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import comb
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Row = npt.NDArray[np.float64]
SIZE = 6  # coefficients of a polynomial of degree 5, the constant first

QUINTIC = np.array([[1, 1, 1], [3, 4, 5], [6, 12, 20]], dtype=np.float64)  # of s³, s⁴, s⁵ at s = 1


class Motion(NamedTuple):
    """State of a motion: position [rad], velocity [rad/s], acceleration [rad/s²], each (n,)."""

    position: Row
    velocity: Row
    acceleration: Row


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Waypoint at a time since the start [s]. Without velocities, the segments are linear.

    `velocity` and `acceleration` are (n,) or None. An acceleration requires a velocity.
    """

    time: float
    position: Row
    velocity: Row | None = None
    acceleration: Row | None = None


class Spline:
    """Piecewise polynomials in time, at rest after the last waypoint.

    Args:
        times: times of the waypoints [s], increasing, (k + 1,).
        coefficients: one polynomial per segment and axis in s = (t - t0) / (t1 - t0),
            (k, 6, n), the constant first.
    """

    def __init__(self, times: Sequence[float], coefficients: Sequence[Row]) -> None:
        self.times = list(times)
        self._coefficients = np.stack(coefficients)

    @property
    def end(self) -> float:
        """Time of the last waypoint [s]."""
        return self.times[-1]

    def at(self, time: float) -> Motion:
        """Return the state at a time [s]. Before the start it is that of the start."""
        if time >= self.end:
            rest = np.zeros(self._coefficients.shape[2])
            return Motion(self._coefficients[-1].sum(axis=0), rest, rest.copy())
        segment = max(0, bisect_right(self.times, time) - 1)
        begin, end = self.times[segment : segment + 2]
        s = min(max((time - begin) / (end - begin), 0.0), 1.0)
        rows, rates = self._coefficients[segment], []
        for order in range(3):
            powers = s ** np.arange(len(rows))
            rates.append(powers @ rows / (end - begin) ** order)
            rows = derivative(rows)
        return Motion(*rates)

    def extremes(self, order: int, low: Row, high: Row) -> tuple[Row, Row]:
        """Compute the lowest and the highest value of each axis.

        The bounds are loose where they are within [`low`, `high`], and exact elsewhere.

        Args:
            order: 0 for positions, 1 for velocities, 2 for accelerations.
            low: lower limits (n,).
            high: upper limits (n,).

        Returns:
            Lowest and highest values, each (n,).
        """
        durations = np.diff(self.times)[:, None, None] ** order
        rows = self._coefficients
        for _ in range(order):
            rows = derivative(rows, axis=1)
        rows = rows / durations
        bounds = np.einsum("ij,kjn->kin", bernstein(rows.shape[1]), rows)
        lowest, highest = bounds.min(axis=1), bounds.max(axis=1)
        for k, i in np.argwhere((lowest < low) | (highest > high)):
            lowest[k, i], highest[k, i] = exact_range(rows[k, :, i])
        return lowest.min(axis=0), highest.max(axis=0)


def bernstein(size: int) -> Row:
    """Return the matrix from power to Bernstein coefficients, (size, size).

    The Bernstein coefficients of a polynomial enclose its values on [0, 1].
    """
    return np.array([[comb(i, k) / comb(size - 1, k) for k in range(size)] for i in range(size)])


def derivative(rows: Row, axis: int = 0) -> Row:
    """Return the coefficients of the derivative of polynomials along `axis`."""
    moved = np.moveaxis(rows, axis, -1)
    return np.moveaxis(moved[..., 1:] * np.arange(1, moved.shape[-1]), -1, axis)


def exact_range(polynomial: Row) -> tuple[float, float]:
    """Return the lowest and the highest value of a polynomial on [0, 1]."""
    slope = np.trim_zeros(derivative(polynomial)[::-1], "f")
    roots = np.roots(slope) if len(slope) > 1 else np.empty(0)
    inside = [float(r.real) for r in roots if abs(r.imag) < 1e-6 and 0 < r.real < 1]
    values = np.polyval(polynomial[::-1], np.array([0.0, 1.0, *inside]))
    return float(values.min()), float(values.max())


def spline(start: Motion, waypoints: Sequence[Waypoint], begin: float) -> Spline:
    """Return a spline from a state through waypoints.

    A segment is quintic if both ends have accelerations, cubic if both have velocities, and
    linear otherwise, as in ros2_control's joint_trajectory_controller ("Trajectory
    Representation"). One difference: from a moving start, the first segment is cubic, so
    that the velocity is continuous.

    Args:
        start: state at the time `begin`.
        waypoints: waypoints after `begin`, with increasing times.
        begin: time of the start [s].

    Returns:
        Spline from `begin` to the last waypoint.
    """
    first = waypoints[0]
    moving = bool(start.velocity.any())
    if first.velocity is None and moving:
        first = Waypoint(first.time, first.position, slope_after(waypoints))
    quintic = first.acceleration is not None
    begins = Waypoint(
        begin,
        start.position,
        None if first.velocity is None else start.velocity,
        start.acceleration if quintic else None,
    )
    points = [begins, first, *waypoints[1:]]
    pieces = [piece(points[0], points[1])]
    pieces += [piece(a, b) for a, b in pairwise(waypoints)]
    return Spline([point.time for point in points], pieces)


def slope_after(waypoints: Sequence[Waypoint]) -> Row:
    """Return the velocity (n,) with which a linear second segment begins; zero without one."""
    if len(waypoints) < 2:
        return np.zeros_like(waypoints[0].position)
    first, second = waypoints[:2]
    slope: Row = (second.position - first.position) / (second.time - first.time)
    return slope


def piece(begin: Waypoint, end: Waypoint) -> Row:
    """Return the coefficients (6, n) of the segment between two waypoints."""
    duration = end.time - begin.time
    rows = np.zeros((SIZE, len(begin.position)))
    rows[0] = begin.position
    change = end.position - begin.position
    if begin.velocity is None or end.velocity is None:
        rows[1] = change
        return rows
    v0, v1 = begin.velocity * duration, end.velocity * duration
    rows[1] = v0
    if begin.acceleration is None or end.acceleration is None:
        rows[2], rows[3] = 3 * change - 2 * v0 - v1, v0 + v1 - 2 * change
        return rows
    a0, a1 = begin.acceleration * duration**2, end.acceleration * duration**2
    rows[2] = a0 / 2
    rows[3:] = np.linalg.solve(QUINTIC, np.stack([change - v0 - a0 / 2, v1 - v0 - a0, a1 - a0]))
    return rows

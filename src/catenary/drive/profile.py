"""Motion profiles of one axis: trapezoidal velocity, or limited jerk by ruckig.

Source of the jerk-limited profile: Berscheid and Kröger, Jerk-limited real-time trajectory
generation with arbitrary target states, RSS 2021.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple, Protocol

from catenary.errors import ConfigurationError


class Motion(NamedTuple):
    """Position, velocity and acceleration of an axis, in its units."""

    position: float
    velocity: float = 0.0
    acceleration: float = 0.0


class Rates(NamedTuple):
    """Limits of a profile, in the units of the axis."""

    velocity: float
    acceleration: float
    jerk: float | None = None  # None for a trapezoidal velocity


class Profile(Protocol):
    """Motion that ends at rest."""

    @property
    def duration(self) -> float:
        """Time until rest [s]."""

    @property
    def goal(self) -> float:
        """Position at rest."""

    def at(self, time: float) -> Motion:
        """Return the motion after `time` [s]."""


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """Profile that consists of phases with constant acceleration."""

    start: Motion
    goal: float
    phases: tuple[tuple[float, float], ...]  # acceleration, duration [s]

    @property
    def duration(self) -> float:
        """Time until rest [s]."""
        return sum(duration for _, duration in self.phases)

    def at(self, time: float) -> Motion:
        """Return the motion after `time` [s]."""
        position, velocity, _ = self.start
        for acceleration, duration in self.phases:
            t = min(time, duration)
            position += velocity * t + 0.5 * acceleration * t * t
            velocity += acceleration * t
            if time < duration:
                return Motion(position, velocity, acceleration)
            time -= duration
        return Motion(self.goal)


def make_profile(start: Motion, goal: float, rates: Rates) -> Profile:
    """Return the fastest profile to rest at a goal.

    If the start is faster than the velocity limit, the profile first decelerates to this limit.

    Args:
        start: motion at the start.
        goal: position at the end.
        rates: limits of the profile.

    Raises:
        ConfigurationError: The jerk is limited, and ruckig is not installed or finds no motion.
    """
    if rates.jerk is None:
        return _trapezoid(start, goal, rates.velocity, rates.acceleration)
    return _jerk_limited(start, goal, rates)


def make_stop(start: Motion, rates: Rates) -> Profile:
    """Return the profile that decelerates to rest as soon as possible.

    Args:
        start: motion at the start.
        rates: limits of the profile; the velocity limit is not used.

    Raises:
        ConfigurationError: The jerk is limited, and ruckig is not installed or finds no motion.
    """
    if rates.jerk is None:
        speed, acceleration = abs(start.velocity), rates.acceleration
        goal = start.position + start.velocity * speed / (2 * acceleration)
        phases = ((-math.copysign(acceleration, start.velocity), speed / acceleration),)
        return Trapezoid(start, goal, phases)
    return _jerk_limited(start, None, rates)


def _trapezoid(start: Motion, goal: float, velocity: float, acceleration: float) -> Trapezoid:
    rest = start.position + start.velocity * abs(start.velocity) / (2 * acceleration)
    sign = 1.0 if goal >= rest else -1.0
    distance, first = sign * (goal - start.position), sign * start.velocity
    if first > velocity:
        begin, peak = -acceleration, velocity
    else:
        begin = acceleration
        peak = min(velocity, math.sqrt(max(acceleration * distance + first * first / 2, 0.0)))
    reach = (peak - first) / begin
    ramps = (peak + first) / 2 * reach + peak * peak / (2 * acceleration)
    cruise = max(distance - ramps, 0.0) / peak if peak > 0 else 0.0
    phases = ((sign * begin, reach), (0.0, cruise), (-sign * acceleration, peak / acceleration))
    return Trapezoid(start, goal, phases)


@dataclass(frozen=True, slots=True)
class JerkLimited:
    """Profile with limited jerk, computed by ruckig."""

    goal: float
    duration: float  # [s]
    trajectory: Any  # ruckig.Trajectory

    def at(self, time: float) -> Motion:
        """Return the motion after `time` [s]."""
        if time >= self.duration:
            return Motion(self.goal)
        return Motion(*(values[0] for values in self.trajectory.at_time(time)[:3]))


def load_ruckig() -> Any:
    """Return the module ruckig.

    Raises:
        ConfigurationError: ruckig is not installed.
    """
    try:
        return import_module("ruckig")
    except ImportError as error:
        raise ConfigurationError(
            "jerk= needs ruckig, which is not installed",
            hint="pip install 'catenary[traj]', or omit jerk= for a trapezoidal velocity",
        ) from error


def _jerk_limited(start: Motion, goal: float | None, rates: Rates) -> JerkLimited:
    """Return the profile to rest at `goal`, or to rest as soon as possible if it is None."""
    ruckig = load_ruckig()
    task = ruckig.InputParameter(1)
    task.current_position = [start.position]
    task.current_velocity = [start.velocity]
    task.current_acceleration = [start.acceleration]
    if goal is None:
        task.control_interface = ruckig.ControlInterface.Velocity
        task.target_velocity = [0.0]
    else:
        task.target_position = [goal]
        task.max_velocity = [rates.velocity]
    task.max_acceleration = [rates.acceleration]
    task.max_jerk = [rates.jerk]
    trajectory = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(task, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ConfigurationError(
            f"cannot compute a motion from {start} to {goal}: ruckig returned {result}",
            hint="try another velocity, acceleration or jerk",
        )
    duration = float(trajectory.duration)
    end = float(trajectory.at_time(duration)[0][0]) if goal is None else goal
    return JerkLimited(end, duration, trajectory)

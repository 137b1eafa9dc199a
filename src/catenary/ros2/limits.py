"""Limits of the axes and tolerances of a motion, one value per axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from catenary.control.parts import PerAxis, checked
from catenary.ros2.spline import Row
from catenary.ros2.waypoints import Code, TrajectoryError

REST = 1e-9  # [rad/s]; a lower speed counts as rest


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """Limits of n axes, each (n,): [rad], [rad/s], [rad/s²]."""

    velocity: Row
    acceleration: Row
    deceleration: Row  # used to stop
    position_min: Row
    position_max: Row

    @classmethod
    def of(
        cls,
        axes: int,
        *,
        velocity: PerAxis,
        deceleration: PerAxis,
        acceleration: PerAxis = math.inf,
        position_min: PerAxis = -math.inf,
        position_max: PerAxis = math.inf,
    ) -> AxisLimits:
        """Return checked limits; each is one value, or one per axis.

        Args:
            axes: number of axes.
            velocity: largest velocity [rad/s].
            deceleration: deceleration of a stop [rad/s²].
            acceleration: largest acceleration of a trajectory [rad/s²].
            position_min: lowest position [rad].
            position_max: highest position [rad].

        Raises:
            ValueError: A limit is not positive, is NaN, or has a wrong number of values.
        """
        return cls(
            checked("velocity", velocity, axes, above=True),
            checked("acceleration", acceleration, axes, above=True),
            checked("deceleration", deceleration, axes, above=True),
            checked("position_min", position_min, axes, least=-math.inf),
            checked("position_max", position_max, axes, least=-math.inf),
        )


@dataclass(frozen=True, slots=True)
class Tolerances:
    """Tolerances of a motion. Infinity means that a value is not checked.

    `path` and `goal` are the largest position errors (n,) [rad] during and after the motion. At
    the goal, no axis is faster than `stopped_velocity` [rad/s]. The axes must be there within
    `goal_time` [s] after the end of the trajectory.
    """

    path: Row
    goal: Row
    goal_time: float = math.inf
    stopped_velocity: float = 0.01

    @classmethod
    def of(
        cls,
        axes: int,
        *,
        path: PerAxis = math.inf,
        goal: PerAxis = math.inf,
        goal_time: float = math.inf,
        stopped_velocity: float = 0.01,
    ) -> Tolerances:
        """Return checked tolerances; `path` and `goal` are one value, or one per axis.

        The default of `stopped_velocity` is that of joint_trajectory_controller.

        Args:
            axes: number of axes.
            path: largest position error during the motion [rad].
            goal: largest position error at the goal [rad].
            goal_time: time to reach the goal after the end of the trajectory [s].
            stopped_velocity: largest velocity at the goal [rad/s].

        Raises:
            ValueError: A tolerance is not positive, is NaN, or has a wrong number of values.
        """
        path = checked("path", path, axes, above=True)
        goal = checked("goal", goal, axes, above=True)
        for name, value in (("goal_time", goal_time), ("stopped_velocity", stopped_velocity)):
            if not value > 0:
                raise ValueError(f"{name}={value} must be positive")
        return cls(path, goal, goal_time, stopped_velocity)


class ToleranceLike(Protocol):
    """`control_msgs/JointTolerance`; only the position is used."""

    @property
    def name(self) -> str: ...
    @property
    def position(self) -> float: ...


def overridden(
    default: Tolerances,
    joints: Sequence[str],
    path: Sequence[ToleranceLike],
    goal: Sequence[ToleranceLike],
    goal_time: float,
) -> Tolerances:
    """Return the tolerances of a FollowJointTrajectory goal.

    As in control_msgs/JointTolerance, 0 selects the default, and a negative value disables the
    check.

    Args:
        default: tolerances without a request.
        joints: names of all axes.
        path: requested path tolerances.
        goal: requested goal tolerances.
        goal_time: requested goal time [s].

    Raises:
        TrajectoryError: A joint is unknown, or a value is not finite.
    """
    rows = {"path": default.path.copy(), "goal": default.goal.copy()}
    for name, requested in (("path", path), ("goal", goal)):
        for each in requested:
            if each.name not in joints:
                raise TrajectoryError(
                    Code.INVALID_JOINTS, f"unknown joint {each.name!r} in the {name} tolerances"
                )
            i = list(joints).index(each.name)
            rows[name][i] = chosen(each.position, float(rows[name][i]), name)
    time = chosen(goal_time, default.goal_time, "goal time")
    return replace(default, path=rows["path"], goal=rows["goal"], goal_time=time)


def chosen(value: float, default: float, name: str) -> float:
    """Return a tolerance: the default for 0, infinity for a negative value.

    Args:
        value: requested tolerance.
        default: tolerance without a request.
        name: name of the tolerance, for the error.

    Raises:
        TrajectoryError: The value is not finite.
    """
    if not math.isfinite(value):
        raise TrajectoryError(Code.INVALID_GOAL, f"the {name} tolerance is {value}")
    if value == 0:
        return default
    return math.inf if value < 0 else value


def check_limits(
    joints: Sequence[str], limits: AxisLimits, ranges: Sequence[tuple[Row, Row]]
) -> None:
    """Check the extremes of a motion.

    Args:
        joints: names of the axes, for errors.
        limits: limits of the axes.
        ranges: lowest and highest positions, velocities and accelerations.

    Raises:
        TrajectoryError: A limit is exceeded.
    """
    bounds = limit_pairs(limits)
    names = (("position", "rad"), ("velocity", "rad/s"), ("acceleration", "rad/s²"))
    for (name, unit), (low, high), (least, most) in zip(names, ranges, bounds, strict=True):
        for i, joint in enumerate(joints):
            value = float(low[i]) if low[i] < least[i] else float(high[i])
            if low[i] < least[i] or high[i] > most[i]:
                limit = least[i] if low[i] < least[i] else most[i]
                raise TrajectoryError(
                    Code.INVALID_GOAL,
                    f"{name} of {joint} reaches {value:.6g} {unit}; the limit is {limit:.6g}",
                )


def limit_pairs(limits: AxisLimits) -> list[tuple[Row, Row]]:
    """Return the lowest and highest permitted values: position, velocity, acceleration.

    The limits of positions and rates are widened for rounding errors.
    """
    slack = 1e-6
    rates = [x * (1 + slack) for x in (limits.velocity, limits.acceleration)]
    positions = (limits.position_min - slack, limits.position_max + slack)
    return [positions, *((-x, x) for x in rates)]


def stop_time(limits: AxisLimits, position: Row, velocity: Row) -> float:
    """Return the duration [s] in which all axes can stop together at constant decelerations.

    No axis decelerates faster than its limit, except to stop before a position limit.

    Args:
        limits: limits of the axes.
        position: positions (n,) [rad].
        velocity: velocities (n,) [rad/s].
    """
    speed = abs(velocity)
    moving = speed > REST
    if not moving.any():
        return 0.0
    bound = np.where(velocity > 0, limits.position_max, limits.position_min)
    room = np.maximum(abs(bound - position), 0.0)
    needed = (speed / limits.deceleration)[moving].max()
    available = (2 * room[moving] / speed[moving]).min()
    return float(min(needed, available))


def worst(name: str, joints: Sequence[str], errors: Row, tolerances: Row) -> str:
    """Return a sentence about the axis that violates a tolerance most.

    Args:
        name: name of the tolerance.
        joints: names of the axes.
        errors: position errors (n,) [rad].
        tolerances: tolerances (n,) [rad].
    """
    i = int(np.argmax(errors / tolerances))  # the first NaN, if there is one
    return (
        f"{name} tolerance of {joints[i]}: the error is {errors[i]:.6g} rad; "
        f"the tolerance is {tolerances[i]:.6g} rad"
    )

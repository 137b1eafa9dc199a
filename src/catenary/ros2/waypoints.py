"""Checks of a `trajectory_msgs/JointTrajectory`, which become waypoints of all axes.

The error codes are those of `control_msgs/action/FollowJointTrajectory`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NoReturn, Protocol

import numpy as np

from catenary.errors import CatenaryError
from catenary.ros2.spline import Motion, Row, Waypoint

NANOSECOND = 1e-9  # [s]
MOST_POINTS = 10_000  # a longer check would outlast the lease of the bridge


class Code(IntEnum):
    """Result codes of FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class TrajectoryError(CatenaryError):
    """A trajectory that is refused. `code` is that of FollowJointTrajectory."""

    def __init__(self, code: Code, text: str) -> None:
        super().__init__(text)
        self.code = code


class TimeLike(Protocol):
    """`builtin_interfaces/Time` or `Duration`, of Catenary or of rclpy."""

    @property
    def sec(self) -> int: ...
    @property
    def nanosec(self) -> int: ...


class PointLike(Protocol):
    """`trajectory_msgs/JointTrajectoryPoint`, of Catenary or of rclpy."""

    @property
    def positions(self) -> Sequence[float]: ...
    @property
    def velocities(self) -> Sequence[float]: ...
    @property
    def accelerations(self) -> Sequence[float]: ...
    @property
    def effort(self) -> Sequence[float]: ...
    @property
    def time_from_start(self) -> TimeLike: ...


class HeaderLike(Protocol):
    """`std_msgs/Header`, of Catenary or of rclpy."""

    @property
    def stamp(self) -> TimeLike: ...


class TrajectoryLike(Protocol):
    """`trajectory_msgs/JointTrajectory`, of Catenary or of rclpy."""

    @property
    def header(self) -> HeaderLike: ...
    @property
    def joint_names(self) -> Sequence[str]: ...
    @property
    def points(self) -> Sequence[PointLike]: ...


@dataclass(frozen=True, slots=True)
class Request:
    """Checked message: start time [s], joints as numbers of axes, and their waypoints.

    `start` is None for "now". The times of the waypoints count from the start.
    """

    start: float | None
    axes: tuple[int, ...]
    points: tuple[Waypoint, ...]


def seconds(time: TimeLike) -> float:
    """Return a time or duration [s]."""
    return time.sec + time.nanosec * NANOSECOND


def checked(trajectory: TrajectoryLike, joints: Sequence[str], partial: bool) -> Request:
    """Check a message without regard to time, limits and the state of the axes.

    Args:
        trajectory: message.
        joints: names of all axes.
        partial: True to accept a trajectory that names some of the joints only.

    Returns:
        Joints and waypoints of the message.

    Raises:
        TrajectoryError: The message has more than 10 000 points, an unknown, duplicate or missing
            joint, a field with a wrong number of values, efforts, a value that is not finite,
            times that do not increase, or a last velocity other than 0.
    """
    axes = numbers(trajectory.joint_names, joints, partial)
    if len(trajectory.points) > MOST_POINTS:
        wrong(f"it has {len(trajectory.points)} points; the limit is {MOST_POINTS}")
    points = tuple(waypoint(k, p, len(axes)) for k, p in enumerate(trajectory.points))
    before = -1.0
    for k, point in enumerate(points):
        if point.time <= before:
            wrong(f"point {k} is at {point.time:g} s, not after the point before it")
        before = point.time
    last = points[-1].velocity
    if last is not None and last.any():
        wrong(f"the last velocity is {last.tolist()}; it must be 0 for all joints")
    stamp = seconds(trajectory.header.stamp)
    return Request(stamp or None, axes, points)


def numbers(names: Sequence[str], joints: Sequence[str], partial: bool) -> tuple[int, ...]:
    """Return the number of the axis of each name.

    Raises:
        TrajectoryError: A name is unknown or given twice, or a joint is missing.
    """
    for name in names:
        if name not in joints:
            known = ", ".join(joints)
            raise TrajectoryError(
                Code.INVALID_JOINTS, f"unknown joint {name!r}; the joints are {known}"
            )
    if len(set(names)) != len(names):
        raise TrajectoryError(Code.INVALID_JOINTS, f"a joint is given twice: {', '.join(names)}")
    missing = [joint for joint in joints if joint not in names]
    if missing and (not partial or not names):
        raise TrajectoryError(Code.INVALID_JOINTS, f"joints are missing: {', '.join(missing)}")
    return tuple(joints.index(name) for name in names)


def waypoint(number: int, point: PointLike, count: int) -> Waypoint:
    """Return a point of a message as a waypoint.

    Args:
        number: number of the point, for errors.
        point: point of the message.
        count: number of joints of the message.

    Raises:
        TrajectoryError: A field has a wrong length or a value that is not finite, positions are
            missing, efforts are given, or accelerations are given without velocities.
    """
    if len(point.effort):
        wrong(f"point {number} has efforts, which are not supported")
    time = seconds(point.time_from_start)
    if time < 0:
        wrong(f"point {number} is at {time:g} s, before the start")
    position = field(number, "positions", point.positions, count)
    velocity = field(number, "velocities", point.velocities, count)
    acceleration = field(number, "accelerations", point.accelerations, count)
    if position is None:
        wrong(f"point {number} has no positions")
    if acceleration is not None and velocity is None:
        wrong(f"point {number} has accelerations without velocities")
    return Waypoint(time, position, velocity, acceleration)


def field(number: int, name: str, values: Sequence[float], count: int) -> Row | None:
    """Return the values of one field; None if it is empty.

    Args:
        number: number of the point, for errors.
        name: name of the field, for errors.
        values: values of the field.
        count: required number of values.

    Raises:
        TrajectoryError: The number of values is wrong, or one is not finite.
    """
    if not len(values):
        return None
    row = np.array(values, dtype=np.float64)
    if len(row) != count:
        wrong(f"point {number} has {len(row)} {name} for {count} joints")
    if not np.isfinite(row).all():
        wrong(f"point {number} has {name} that are not finite: {row.tolist()}")
    return row


def wrong(text: str) -> NoReturn:
    """Raise TrajectoryError with INVALID_GOAL."""
    raise TrajectoryError(Code.INVALID_GOAL, text)


def for_all_axes(request: Request, begin: float, start: Motion) -> list[Waypoint]:
    """Complete the waypoints for the axes that the message does not name.

    These axes stop at a constant deceleration until the first waypoint, and hold.

    Args:
        request: checked message, with its remaining waypoints.
        begin: time of `start`, on the scale of the times of the waypoints [s].
        start: state of all axes at the begin of the motion.

    Returns:
        Waypoints of all axes.
    """
    chosen = list(request.axes)
    until = request.points[0].time - begin
    rest = start.position + start.velocity * until / 2
    still = np.zeros_like(rest)

    def complete(base: Row, values: Row) -> Row:
        row = base.copy()
        row[chosen] = values
        return row

    return [
        Waypoint(
            point.time,
            complete(rest, point.position),
            None if point.velocity is None else complete(still, point.velocity),
            None if point.acceleration is None else complete(still, point.acceleration),
        )
        for point in request.points
    ]

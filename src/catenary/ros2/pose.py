"""Motions to a `geometry_msgs/PoseStamped`.

Rules:

- A pose that is not finite, in another frame, or out of reach within the joint limits is refused.
- The site moves in a straight line with limited linear and angular speeds. All axes stay within
  their velocity and deceleration limits; where one is at its limit, the motion is slower.
- Where the condition number of the Jacobian exceeds 30 and would increase further, the arm stops.
  30 is the default of MoveIt Servo (`hard_stop_singularity_threshold`).
- Without progress for 0.5 s, and without a new message within the time-out, the arm stops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from catenary.ros2.forward import CommandError
from catenary.ros2.goal import AxisStates
from catenary.ros2.kinematics import Kinematics, Pose, condition, damped, reached
from catenary.ros2.limits import AxisLimits
from catenary.ros2.spline import Row

SINGULAR = 30.0  # condition number of the Jacobian
PATIENCE, PROGRESS = 0.5, 0.99  # [s], ratio of two errors
GAIN = 10.0  # [1/s] of the approach over the last millimetres
RAMP = 0.25  # [s] from rest to the limits of the speed
DAMPING = 1e-6
ARRIVED = 1e-4, 1e-3  # [m], [rad]


class PositionLike(Protocol):
    """`geometry_msgs/Point`."""

    @property
    def x(self) -> float: ...
    @property
    def y(self) -> float: ...
    @property
    def z(self) -> float: ...


class QuaternionLike(PositionLike, Protocol):
    """`geometry_msgs/Quaternion`."""

    @property
    def w(self) -> float: ...


class PoseLike(Protocol):
    """`geometry_msgs/Pose`."""

    @property
    def position(self) -> PositionLike: ...
    @property
    def orientation(self) -> QuaternionLike: ...


class HeaderLike(Protocol):
    """`std_msgs/Header`."""

    @property
    def frame_id(self) -> str: ...


class PoseStampedLike(Protocol):
    """`geometry_msgs/PoseStamped`, of Catenary or of rclpy."""

    @property
    def header(self) -> HeaderLike: ...
    @property
    def pose(self) -> PoseLike: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseOptions:
    """Options of a `PoseCommand`: speeds [m/s, rad/s], time-out [s], and name of the base frame.

    `timeout` is the longest time between two messages. Infinity lets one message suffice.
    """

    linear_speed: float = 0.1
    angular_speed: float = 0.5
    timeout: float = 0.5
    frame: str = "base_link"

    def __post_init__(self) -> None:
        """Check the numbers. Raises ValueError for one that is not positive."""
        for name in ("linear_speed", "angular_speed", "timeout"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name}={getattr(self, name)} must be positive")


class PoseCommand:
    """Owns the motion of an arm to the newest pose.

    Args:
        kinematics: kinematics of the arm, with one joint per axis.
        limits: limits of the axes; those of the model apply too.
        options: further options.
    """

    def __init__(
        self, kinematics: Kinematics, limits: AxisLimits, options: PoseOptions | None = None
    ) -> None:
        self._arm, self._limits = kinematics, limits
        self._options = options or PoseOptions()
        self._low = np.maximum(limits.position_min, kinematics.position_min)
        self._high = np.minimum(limits.position_max, kinematics.position_max)
        self._target: Pose | None = None
        self._position = self._velocity = np.zeros(len(kinematics.joints))
        self._then = self._received = self._progressed = -math.inf
        self._best = math.inf
        self._halt = ""  # reason of the stop that is under way

    @property
    def active(self) -> bool:
        """True while set-points must be sent."""
        return self._target is not None

    @property
    def velocity(self) -> Row:
        """Velocities of the joints after the last sample [rad/s], shape (joints,)."""
        return self._velocity

    def accept(self, message: PoseStampedLike, now: float, state: AxisStates) -> None:
        """Check a pose and move to it. A motion that is under way continues from its velocity.

        Args:
            message: message `geometry_msgs/PoseStamped`.
            now: time [s].
            state: state of the axes.

        Raises:
            CommandError: The pose is refused. The motion before it continues.
        """
        target = checked_pose(message, self._options.frame)
        begin = self._position if self.active else np.array(state.commanded_position, np.float64)
        found = self._arm.solve(target, begin)
        if found is None or (found < self._low).any() or (found > self._high).any():
            raise CommandError(
                f"the pose at {target.position.round(4).tolist()} m is out of reach within the "
                "joint limits"
            )
        if not self.active:
            self._position, self._velocity, self._then = begin, np.zeros_like(begin), now
        self._target, self._halt = target, ""
        self._received = self._progressed = now
        self._best = math.inf

    def sample(self, now: float, state: AxisStates) -> Row | None:
        """Return the joint positions (n,) [rad]; None without a motion.

        Args:
            now: time [s].
            state: state of the axes; not used, since the motion continues from its set-points.

        Raises:
            CommandError: The motion has stopped before the pose.
        """
        if self._target is None:
            return None
        step = max(now - self._then, 0.0)
        self._then = max(now, self._then)
        error = self._arm.error(self._target, self._arm.pose(self._position))
        arrived = reached(error, *ARRIVED)
        if now - self._received > self._options.timeout:
            if arrived and not self._velocity.any():
                self._end()
                return None
            self._halt = self._halt or f"no message for {self._options.timeout:g} s"
        self._observe(error, now, arrived)
        wanted = np.zeros_like(self._velocity) if self._halt else self._rates(error)
        self._move(wanted, step)
        if self._halt and not self._velocity.any():
            reason = self._halt
            self._end()
            raise CommandError(reason)
        return self._position

    def stop(self) -> None:
        """End the motion at once, because the axes cannot be commanded."""
        self._end()

    def _end(self) -> None:
        self._target, self._halt = None, ""

    def _observe(self, error: Row, now: float, arrived: bool) -> None:
        """Begin a stop if the error has not decreased for a while."""
        size = float(np.linalg.norm(error))
        if arrived or size < PROGRESS * self._best:
            self._best, self._progressed = size, now
        elif now - self._progressed > PATIENCE:
            self._halt = self._halt or f"no progress for {PATIENCE:g} s, at a limit of a joint"

    def _rates(self, error: Row) -> Row:
        """Return the wanted joint velocities (n,); zero, and a stop, close to a singularity."""
        options = self._options
        linear = approach(float(np.linalg.norm(error[:3])), options.linear_speed)
        angular = approach(float(np.linalg.norm(error[3:])), options.angular_speed)
        slowest = min(linear, angular)  # both parts arrive together
        jacobian = self._arm.jacobian(self._position)
        rates = damped(jacobian, error * slowest, DAMPING)
        number = condition(jacobian)
        if number > SINGULAR:
            ahead = self._position + rates * 1e-3
            if condition(self._arm.jacobian(ahead)) > number:
                self._halt = f"close to a singularity: condition number {number:.3g}"
                return np.zeros_like(rates)
        most = float((abs(rates) / self._limits.velocity).max())
        return rates / max(most, 1.0)

    def _move(self, wanted: Row, step: float) -> None:
        """Change the velocity within the deceleration limit, and move for `step` [s]."""
        if not step:
            return
        change = self._limits.deceleration * step
        velocity = self._velocity + np.clip(wanted - self._velocity, -change, change)
        position = np.clip(self._position + velocity * step, self._low, self._high)
        self._velocity = (position - self._position) / step
        self._velocity[abs(self._velocity) < 1e-9] = 0.0
        self._position = position


def approach(distance: float, speed: float) -> float:
    """Return the rate [1/s] at which a distance decreases: constant speed, then deceleration.

    Args:
        distance: remaining distance [m or rad].
        speed: limit of the speed [m/s or rad/s].
    """
    if distance == 0:
        return GAIN
    braking = math.sqrt(2 * speed / RAMP * distance)
    return min(speed, braking, GAIN * distance) / distance


def checked_pose(message: PoseStampedLike, frame: str) -> Pose:
    """Return the pose of a message.

    Args:
        message: message `geometry_msgs/PoseStamped`.
        frame: required frame; an empty frame in the message is accepted.

    Raises:
        CommandError: The frame differs, a number is not finite, or the quaternion is not a unit
            quaternion.
    """
    given = message.header.frame_id
    if given not in ("", frame):
        raise CommandError(f"the pose is in the frame {given!r}; the arm needs {frame!r}")
    p, q = message.pose.position, message.pose.orientation
    position = np.array([p.x, p.y, p.z], dtype=np.float64)
    quaternion = np.array([q.w, q.x, q.y, q.z], dtype=np.float64)
    if not (np.isfinite(position).all() and np.isfinite(quaternion).all()):
        raise CommandError("the pose has numbers that are not finite")
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1) > 1e-3:
        raise CommandError(f"the quaternion has the norm {norm:.6g} instead of 1")
    return Pose(position, quaternion / norm)

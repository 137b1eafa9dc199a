"""Set-points of all axes from a `std_msgs/Float64MultiArray`, with a time-out.

As in ros2_control's forward_command_controller, `data` has one value per joint, in the order of
the joints. It has neither time-out nor limits; both exist here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, Protocol

import numpy as np

from catenary.control.parts import PerAxis, checked
from catenary.errors import CatenaryError
from catenary.ros2.goal import AxisStates
from catenary.ros2.limits import AxisLimits
from catenary.ros2.spline import Row

Quantity = Literal["position", "velocity", "torque"]
UNITS = {"position": "rad", "velocity": "rad/s", "torque": "N·m"}


class CommandError(CatenaryError):
    """A command that is refused."""


class ArrayLike(Protocol):
    """`std_msgs/Float64MultiArray`, of Catenary or of rclpy."""

    @property
    def data(self) -> Sequence[float]: ...


class ForwardCommand:
    """Owns the newest set-points of some axes.

    Positions are approached with at most the velocity limit. Velocities change with at most the
    deceleration limit; before a position limit, the axis stops. Torques are passed on. Without a
    new message within `timeout`, positions hold, velocities decelerate to 0, and torques end.

    Args:
        joints: names of the axes.
        limits: limits of the axes.
        quantity: meaning of the values.
        timeout: longest time between two messages [s].
        torque_limit: largest torque [N·m], one value or one per axis; required for "torque".

    Raises:
        ValueError: `timeout` is not positive, or `torque_limit` is missing or not valid.
    """

    def __init__(
        self,
        joints: Sequence[str],
        limits: AxisLimits,
        quantity: Quantity,
        timeout: float,
        *,
        torque_limit: PerAxis | None = None,
    ) -> None:
        if not 0 < timeout < math.inf:
            raise ValueError(f"timeout={timeout} s must be positive and finite")
        if quantity == "torque" and torque_limit is None:
            raise ValueError("torque commands need a torque_limit")
        self.joints = tuple(joints)
        self.quantity: Quantity = quantity
        self.timeouts = 0  # number of commands that ended by the time-out
        self._limits, self._timeout = limits, timeout
        self._bounds = self._permitted(0.0 if torque_limit is None else torque_limit)
        self._wanted: Row | None = None
        self._sent: Row | None = None
        self._expires = self._then = -math.inf

    @property
    def active(self) -> bool:
        """True while set-points must be sent."""
        return self._sent is not None

    def accept(self, message: ArrayLike, now: float, state: AxisStates) -> None:
        """Check a message and take its set-points.

        Args:
            message: message `std_msgs/Float64MultiArray`.
            now: time [s].
            state: state of the axes.

        Raises:
            CommandError: The number of values is wrong, a value is not finite or beyond its limit.
                The command before it continues until its time-out.
        """
        wanted = np.array(message.data, dtype=np.float64)
        self._check(wanted)
        if self._sent is None:
            positions = np.array(state.commanded_position, dtype=np.float64)
            self._sent = positions if self.quantity == "position" else np.zeros(len(wanted))
            self._then = now
        self._wanted, self._expires = wanted, now + self._timeout

    def sample(self, now: float, state: AxisStates) -> Row | None:
        """Return the set-points (n,) in the unit of the quantity; None without a command.

        Args:
            now: time [s].
            state: state of the axes.
        """
        if self._sent is None:
            return None
        if self._wanted is not None and now > self._expires:
            self._wanted, self.timeouts = None, self.timeouts + 1
        step = min(max(now - self._then, 0.0), self._timeout)
        self._then = max(now, self._then)
        self._sent = self._next(self._sent, step, state)
        return self._sent

    def stop(self) -> None:
        """End the command without a deceleration, because the axes cannot be commanded."""
        self._wanted = self._sent = None

    def _permitted(self, torque: PerAxis) -> tuple[Row, Row]:
        limits, axes = self._limits, len(self.joints)
        if self.quantity == "position":
            return limits.position_min, limits.position_max
        velocity = self.quantity == "velocity"
        most = limits.velocity if velocity else checked("torque_limit", torque, axes)
        return -most, most

    def _check(self, wanted: Row) -> None:
        if wanted.shape != (len(self.joints),):
            raise CommandError(f"{wanted.size} values for {len(self.joints)} joints")
        if not np.isfinite(wanted).all():
            raise CommandError(f"values that are not finite: {wanted.tolist()}")
        low, high = self._bounds
        for i in np.flatnonzero((wanted < low) | (wanted > high)).tolist():
            limit = low[i] if wanted[i] < low[i] else high[i]
            raise CommandError(
                f"{self.quantity} {wanted[i]:g} {UNITS[self.quantity]} for {self.joints[i]} is "
                f"beyond the limit {limit:g}"
            )

    def _next(self, sent: Row, step: float, state: AxisStates) -> Row | None:
        """Return the set-points after `step` [s]; None at the end of the command."""
        if self.quantity == "torque":
            return self._wanted
        if self.quantity == "position":
            return self._position(sent, step)
        wanted = np.zeros_like(sent) if self._wanted is None else self._wanted
        change = self._limits.deceleration * step if step else np.zeros_like(sent)
        speed = sent + np.clip(wanted - sent, -change, change)
        speed = self._within(speed, state.commanded_position)
        return speed if self._wanted is not None or speed.any() else None

    def _position(self, sent: Row, step: float) -> Row | None:
        if self._wanted is None:
            return None
        change = self._limits.velocity * step if step else np.zeros_like(sent)
        moved: Row = sent + np.clip(self._wanted - sent, -change, change)
        return moved

    def _within(self, speed: Row, position: Row) -> Row:
        """Return velocities that can still stop before the position limits: v² <= 2 a d."""
        limits = self._limits
        up = braking_speed(limits.deceleration, limits.position_max - position)
        down = braking_speed(limits.deceleration, position - limits.position_min)
        slow: Row = np.clip(speed, -down, up)
        return slow


def braking_speed(deceleration: Row, room: Row) -> Row:
    """Return the speeds (n,) [rad/s] from which axes can stop; 0 without room.

    Args:
        deceleration: decelerations (n,) [rad/s²]; may be infinite.
        room: distances to the limits (n,) [rad]; may be negative or infinite.
    """
    speed = np.zeros_like(room)
    free = room > 0
    speed[free] = np.sqrt(2 * deceleration[free] * room[free])
    return speed

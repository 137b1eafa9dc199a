"""Execution of the messages of each command topic: trajectories and streams of set-points."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from catenary.errors import ConfigurationError
from catenary.remote.messages import Axis
from catenary.ros2.commands import CommandError, Follower, SetPoints, State, Values
from catenary.ros2.config import Config, Quantity
from catenary.ros2.config import Trajectory as TrajectoryConfig
from catenary.ros2.goal import AxisStates, Goal, Status
from catenary.ros2.limits import AxisLimits, Tolerances
from catenary.ros2.trajectory import TrajectoryFollower

SETTLED = 1e-6  # [rad] between the last set-point and the commanded position
SETTLE_TIME = 1.0  # [s] at most, after the end of a trajectory
FINITE = float(np.finfo(np.float64).max)  # a bound that refuses infinity
UNITS: Mapping[Quantity, str] = {"position": "rad", "velocity": "rad/s", "torque": "N·m"}


def make_followers(
    config: Config, axes: Sequence[str], known: Sequence[Axis]
) -> dict[str, Follower]:
    """Return a follower for each command topic.

    Args:
        config: configuration of the bridge.
        axes: names of the commanded axes.
        known: axes of the loop with their limits.

    Raises:
        ConfigurationError: The loop lacks an axis.
    """
    by_name = {axis.name: axis for axis in known}
    missing = [name for name in axes if name not in by_name]
    if missing:
        raise ConfigurationError(
            f"commands.axes: there is no axis {missing[0]!r}; the axes are {', '.join(by_name)}"
        )
    chosen = [by_name[name] for name in axes]
    joints = [config.joints.get(name, name) for name in axes]
    commands = config.commands
    forward, point = commands.forward, commands.point
    return {
        "trajectory": TrajectoryCommand(joints, limits_of(chosen), commands.trajectory),
        "forward": StreamCommand(forward.quantity, forward.timeout, chosen, lambda m: m.data),
        "point": StreamCommand("position", point.timeout, chosen, lambda m: m.positions),
    }


def limits_of(axes: Sequence[Axis]) -> AxisLimits:
    """Return the limits of axes; missing limits are infinite."""
    return AxisLimits.of(
        len(axes),
        velocity=row(axes, lambda axis: axis.velocity_limit, math.inf),
        acceleration=row(axes, lambda axis: axis.acceleration, math.inf),
        deceleration=row(axes, lambda axis: axis.deceleration, math.inf),
        position_min=row(axes, lambda axis: axis.position_min, -math.inf),
        position_max=row(axes, lambda axis: axis.position_max, math.inf),
    )


def row(axes: Sequence[Axis], limit: Callable[[Axis], float | None], missing: float) -> Values:
    """Return one limit of all axes, shape (axes,).

    Args:
        axes: the axes.
        limit: returns the limit of an axis.
        missing: value of a missing limit.
    """
    found = [limit(axis) for axis in axes]
    return np.array([missing if value is None else value for value in found], np.float64)


class TrajectoryCommand:
    """Follower of trajectory_msgs/JointTrajectory.

    Args:
        joints: names of the joints.
        limits: limits of the axes.
        config: tolerances.
    """

    quantity: Quantity = "position"

    def __init__(self, joints: Sequence[str], limits: AxisLimits, config: TrajectoryConfig) -> None:
        tolerances = Tolerances.of(
            len(joints),
            path=config.path_tolerance or math.inf,
            goal=config.goal_tolerance or math.inf,
            goal_time=config.goal_time or math.inf,
        )
        self._follower = TrajectoryFollower(joints, limits, tolerances)
        self._goal: Goal | None = None
        self._now = 0.0
        self._settled_at: float | None = None

    def accept(self, message: Any, now: float, state: State) -> None:
        """Start a trajectory; see `TrajectoryFollower.accept`."""
        self._now = now
        self._goal = self._follower.accept(message, now, axis_states(state))
        self._settled_at = None

    def sample(self, now: float, state: State) -> SetPoints | None:
        """Return the positions of the trajectory [rad]; None after its end."""
        self._now = now
        position, _ = self._follower.sample(now, axis_states(state))
        if not self._follower.active:
            self._raise_failure()
            if self._settled_at is None:
                self._settled_at = now + SETTLE_TIME
            lag = float(abs(position - state.commanded).max())
            if lag <= SETTLED or now >= self._settled_at:
                return None
        return {"position": position}

    def cancel(self) -> None:
        """Forget the trajectory."""
        self._follower.abort("another command, or the end of the lease")
        self._goal = None

    def _raise_failure(self) -> None:
        """Raise CommandError if the goal was aborted."""
        result = self._goal.result if self._goal is not None else None
        if result is not None and result.status is Status.ABORTED:
            raise CommandError(result.text)


def axis_states(state: State) -> AxisStates:
    """Return the state as the follower of trajectories needs it."""
    return AxisStates(state.position, state.velocity, state.commanded)


class StreamCommand:
    """Follower of a stream of set-points, which must continue.

    A position set-point moves to the received one with the velocity limit at most, so that a step
    in the stream does not stop the axes.

    Args:
        quantity: quantity of the set-points.
        timeout: longest time between two messages [s].
        axes: commanded axes.
        extract: returns the numbers of a message.
    """

    def __init__(
        self,
        quantity: Quantity,
        timeout: float,
        axes: Sequence[Axis],
        extract: Callable[[Any], Sequence[float]],
    ) -> None:
        self.quantity = quantity
        self._timeout = timeout
        self._names = [axis.name for axis in axes]
        self._extract = extract
        self._velocity = row(axes, lambda axis: axis.velocity_limit, math.inf)
        self._low, self._high = range_of(quantity, axes)
        self._target: Values | None = None
        self._set_point: Values | None = None
        self._received = self._sampled = 0.0

    def accept(self, message: Any, now: float, state: State) -> None:
        """Take new set-points. Raises CommandError for a wrong number, NaN or a limit."""
        given = np.array(self._extract(message), np.float64)
        if given.shape != (len(self._names),):
            raise CommandError(f"{given.size} numbers for {len(self._names)} axes")
        for name, value, low, high in zip(self._names, given, self._low, self._high, strict=True):
            if not low <= value <= high:  # also for NaN
                unit = UNITS[self.quantity]
                raise CommandError(
                    f"{self.quantity} {value:.6g} {unit} of {name!r} is outside {low:g} to {high:g}"
                )
        if self._set_point is None:
            self._set_point, self._sampled = state.commanded, now
        self._target, self._received = given, now

    def sample(self, now: float, state: State) -> SetPoints | None:
        """Return the set-points. Raises CommandError after the time-out."""
        if self._target is None or self._set_point is None:
            return None
        if now - self._received > self._timeout:
            raise CommandError(f"no message for {self._timeout:g} s")
        if self.quantity != "position":
            return {self.quantity: self._target}
        elapsed = max(now - self._sampled, 0.0)
        step = self._velocity * elapsed if elapsed else np.zeros_like(self._velocity)
        self._set_point = self._set_point + np.clip(self._target - self._set_point, -step, step)
        self._sampled = max(now, self._sampled)
        return {"position": self._set_point}

    def cancel(self) -> None:
        """Forget the stream."""
        self._target = self._set_point = None


def range_of(quantity: Quantity, axes: Sequence[Axis]) -> tuple[Values, Values]:
    """Return the smallest and the largest set-points of axes.

    Args:
        quantity: quantity of the set-points.
        axes: the axes.
    """
    if quantity == "position":
        low = row(axes, lambda axis: axis.position_min, -math.inf)
        high = row(axes, lambda axis: axis.position_max, math.inf)
        return np.maximum(low, -FINITE), np.minimum(high, FINITE)
    limit = row(
        axes,
        (lambda axis: axis.velocity_limit)
        if quantity == "velocity"
        else (lambda axis: axis.torque_limit),
        FINITE,
    )
    high = np.minimum(limit, FINITE)
    return -high, high

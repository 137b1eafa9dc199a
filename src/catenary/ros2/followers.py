"""Execution of the messages of each command topic: trajectories and streams of set-points."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from catenary.errors import ConfigurationError
from catenary.remote.messages import Axis
from catenary.ros2.commands import HELD, Follower, SetPoints, State, Values
from catenary.ros2.config import Config, Quantity
from catenary.ros2.config import Pose as PoseConfig
from catenary.ros2.config import Trajectory as TrajectoryConfig
from catenary.ros2.diagnostics import Reports
from catenary.ros2.forward import CommandError, ForwardCommand
from catenary.ros2.goal import AxisStates, Goal, Status
from catenary.ros2.joint_map import JointMap
from catenary.ros2.kinematics import Kinematics
from catenary.ros2.limits import AxisLimits, ToleranceLike, Tolerances, overridden
from catenary.ros2.pose import PoseCommand, PoseOptions
from catenary.ros2.trajectory import TrajectoryFollower

UNLIMITED = 1e9  # [rad/s, rad/s²]; finite, because infinity times 0 s is not a number
STOPPED = 0.01  # [rad/s] at the goal, if its tolerance is checked
SETTLED = 1e-6  # [rad] between the last set-point and the commanded position
SETTLE_TIME = 1.0  # [s] at most, after the end of a trajectory


def make_followers(
    config: Config, axes: Sequence[str], known: Sequence[Axis], reports: Reports
) -> dict[str, Follower]:
    """Return a follower for each command topic.

    Args:
        config: configuration of the bridge.
        axes: names of the commanded axes.
        known: axes of the loop with their limits.
        reports: receives the time-outs of streams.

    Raises:
        ConfigurationError: The loop lacks an axis, or an axis lacks a limit.
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
    forward, timeout, limits = commands.forward, commands.point.timeout, limits_of(chosen)
    made: dict[str, Follower] = {
        "trajectory": TrajectoryCommand(joints, limits, commands.trajectory),
        "point": StreamCommand(
            ForwardCommand(joints, limits, "position", timeout), lambda m: m.positions, reports
        ),
    }
    if forward.on:
        torque = row(chosen, lambda axis: axis.torque_limit, math.nan)
        if forward.quantity == "torque" and np.isnan(torque).any():
            raise ConfigurationError(
                "commands.forward: torques need a torque limit of each axis",
                hint="pass torque_limit= to Drives",
            )
        command = ForwardCommand(
            joints, limits, forward.quantity, forward.timeout, torque_limit=torque
        )
        made["forward"] = StreamCommand(command, lambda m: m.data, reports)
    if commands.joint_states is not None:
        mapped = commands.joint_states
        command = ForwardCommand(joints, limits, "position", mapped.timeout)
        made["joint_states"] = StreamCommand(command, JointMap(mapped.axes, axes), reports)
    if commands.pose is not None:
        made["pose"] = make_pose(commands.pose, len(axes), limits)
    return made


def make_pose(config: PoseConfig, axes: int, limits: AxisLimits) -> Follower:
    """Return the follower of poses.

    Args:
        config: model, site and speeds.
        axes: number of commanded axes.
        limits: limits of the axes.

    Raises:
        ConfigurationError: MuJoCo is missing, or the model does not fit.
    """
    kinematics = Kinematics(config.model, config.site, joints=config.joints, axes=axes)
    options = PoseOptions(
        linear_speed=config.linear_speed,
        angular_speed=config.angular_speed,
        timeout=config.timeout,
        frame=config.frame,
    )
    return PoseFollower(PoseCommand(kinematics, limits, options))


def limits_of(axes: Sequence[Axis]) -> AxisLimits:
    """Return the limits of axes. Missing limits are without effect."""
    return AxisLimits.of(
        len(axes),
        velocity=row(axes, lambda axis: axis.velocity_limit, UNLIMITED),
        acceleration=row(axes, lambda axis: axis.acceleration, UNLIMITED),
        deceleration=row(axes, lambda axis: axis.deceleration, UNLIMITED),
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


class GoalRequest(NamedTuple):
    """Trajectory of the action FollowJointTrajectory, with its tolerances."""

    trajectory: Any
    path: Sequence[ToleranceLike]
    goal: Sequence[ToleranceLike]
    goal_time: float  # [s]


class TrajectoryCommand:
    """Follower of trajectory_msgs/JointTrajectory and of `GoalRequest`.

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
            stopped_velocity=STOPPED if config.goal_tolerance else math.inf,
        )
        self.planned: Values | None = None  # [rad], at the last sample
        self.measured: Values | None = None  # [rad], at the last sample
        self._follower = TrajectoryFollower(joints, limits, tolerances)
        self._goal: Goal | None = None
        self._now = 0.0
        self._settled_at: float | None = None

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self._follower.joints

    def accept(self, message: Any, now: float, state: State) -> Goal:
        """Start a trajectory; see `TrajectoryFollower.accept`."""
        self._now, tolerances = now, None
        if isinstance(message, GoalRequest):
            message, path, goal, goal_time = message
            default = self._follower.tolerances
            tolerances = overridden(default, self.joints, path, goal, goal_time)
        self._goal = self._follower.accept(message, now, axis_states(state), tolerances)
        self._settled_at = None
        return self._goal

    def decelerate(self) -> None:
        """Cancel the goal. The axes decelerate, then hold."""
        self._follower.cancel(self._now)

    def sample(self, now: float, state: State) -> SetPoints | None:
        """Return the positions and velocities [rad, rad/s]; None after the end."""
        self._now = now
        position, velocity = self._follower.sample(now, axis_states(state))
        self.planned, self.measured = position, state.position
        if not self._follower.active:
            self._raise_failure()
            if self._settled_at is None:
                self._settled_at = now + SETTLE_TIME
            lag = float(abs(position - state.commanded).max())
            if lag <= SETTLED or now >= self._settled_at:
                return None
        return {"position": position, "velocity": velocity}

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


class Numbers(NamedTuple):
    """Numbers of a message, as `ForwardCommand` reads them."""

    data: Sequence[float]


class StreamCommand:
    """Follower of a stream of set-points, which must continue.

    Args:
        command: executes the set-points.
        extract: returns the numbers of a message.
        reports: receives the time-outs.
    """

    def __init__(
        self,
        command: ForwardCommand,
        extract: Callable[[Any], Sequence[float]],
        reports: Reports,
    ) -> None:
        self.quantity = command.quantity
        self._command, self._extract, self._reports = command, extract, reports

    def accept(self, message: Any, now: float, state: State) -> None:
        """Take new set-points; see `ForwardCommand.accept`."""
        self._command.accept(Numbers(self._extract(message)), now, axis_states(state))

    def sample(self, now: float, state: State) -> SetPoints | None:
        """Return the set-points; None after the time-out, when the axes have stopped."""
        before = self._command.timeouts
        found = self._command.sample(now, axis_states(state))
        if self._command.timeouts > before:
            self._reports.add(HELD, "the stream of set-points has ended: no message in time")
        return None if found is None else {self.quantity: found}

    def cancel(self) -> None:
        """Forget the stream."""
        self._command.stop()


class PoseFollower:
    """Follower of geometry_msgs/PoseStamped.

    Args:
        command: executes the poses.
    """

    quantity: Quantity = "position"

    def __init__(self, command: PoseCommand) -> None:
        self._command = command

    def accept(self, message: Any, now: float, state: State) -> None:
        """Move to a pose; see `PoseCommand.accept`."""
        self._command.accept(message, now, axis_states(state))

    def sample(self, now: float, state: State) -> SetPoints | None:
        """Return the positions and velocities [rad, rad/s]; None at the end of the motion."""
        found = self._command.sample(now, axis_states(state))
        return None if found is None else {"position": found, "velocity": self._command.velocity}

    def cancel(self) -> None:
        """Forget the pose."""
        self._command.stop()

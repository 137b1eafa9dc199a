"""The action FollowJointTrajectory of a bridge. Its goals are executed like those of the topic."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from catenary.ros2.followers import GoalRequest, TrajectoryCommand
from catenary.ros2.goal import Goal
from catenary.ros2.interface import Backend
from catenary.ros2.limits import ToleranceLike
from catenary.ros2.waypoints import TrajectoryLike

FEEDBACK_INTERVAL = 0.05  # [s]; action_monitor_rate of joint_trajectory_controller is 20 Hz


class TrajectoryAction:
    """Owner of the action. It executes the goals of the server.

    Args:
        backend: the node.
        name: name of the action.
        start: starts a goal, or raises CatenaryError.
        cancel: cancels the goal.

    Raises:
        NotAvailable: The backend has no actions.
        ConfigurationError: control_msgs is not installed.
    """

    def __init__(
        self,
        backend: Backend,
        name: str,
        start: Callable[[GoalRequest], Goal],
        cancel: Callable[[], None],
    ) -> None:
        self._start, self._cancel = start, cancel
        self._feedback_at = 0.0
        self._server = backend.follow_joint_trajectory(name, self)

    def start(
        self,
        trajectory: TrajectoryLike,
        path: Sequence[ToleranceLike],
        goal: Sequence[ToleranceLike],
        goal_time: float,
    ) -> Goal:
        """Start a goal at once.

        Args:
            trajectory: trajectory of the goal.
            path: path tolerances.
            goal: goal tolerances.
            goal_time: time to reach the goal after the end [s].

        Raises:
            CatenaryError: The goal is refused.
        """
        return self._start(GoalRequest(trajectory, path, goal, goal_time))

    def cancel(self) -> None:
        """Cancel the goal: the axes decelerate, then hold."""
        self._cancel()

    def step(self, command: TrajectoryCommand | None) -> None:
        """Send results and, when due, feedback. Without a loop, pass None for `command`."""
        self._server.step()
        now = time.monotonic()
        if command is None or now < self._feedback_at:
            return
        if command.planned is not None and command.measured is not None:
            self._feedback_at = now + FEEDBACK_INTERVAL
            self._server.feedback(
                command.joints, command.planned.tolist(), command.measured.tolist()
            )

    def close(self) -> None:
        """Remove the action from the graph."""
        self._server.close()

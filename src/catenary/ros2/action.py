"""Action server of `control_msgs/action/FollowJointTrajectory` on rclpy.

NOT RUN with rclpy: control_msgs has no wheel, so that no test environment of Catenary contains it.
The tests use doubles of rclpy. The semantics are those of `trajectory.TrajectoryFollower`, which
is fully tested. The bridge offers this action where rclpy and control_msgs are importable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from catenary.errors import CatenaryError, ConfigurationError
from catenary.ros2.goal import Goal, Result, Status
from catenary.ros2.interface import Executor
from catenary.ros2.waypoints import Code, TrajectoryError, seconds


@dataclass(frozen=True, slots=True)
class Running:
    """Goal without a result yet."""

    goal: Goal
    handle: Any  # rclpy.action.server.ServerGoalHandle
    future: Any  # rclpy.task.Future


class FollowJointTrajectoryServer:
    """Owns the action server and the goals that are being executed.

    Every goal is accepted by the protocol. A refused trajectory is aborted with its code and text,
    since the rejection of a goal carries neither.

    Args:
        node: node of rclpy.
        name: name of the action, such as "follow_joint_trajectory".
        executor: execution of the goals.

    Raises:
        ConfigurationError: rclpy or control_msgs is not installed.
    """

    def __init__(self, node: Any, name: str, executor: Executor) -> None:
        self._executor = executor
        self._action = required("control_msgs.action").FollowJointTrajectory
        self._rclpy_action = required("rclpy.action")
        self._new_future: Callable[[], Any] = required("rclpy.task").Future
        self._running: list[Running] = []
        self._server = self._rclpy_action.ActionServer(
            node,
            self._action,
            name,
            execute_callback=self._execute,
            goal_callback=self._accept,
            cancel_callback=self._cancel,
        )

    def step(self) -> None:
        """Send the results of finished goals. Call it after each sample of the follower."""
        finished = [each for each in self._running if each.goal.finished]
        self._running = [each for each in self._running if not each.goal.finished]
        for each in finished:
            each.future.set_result(each.goal.result)

    def feedback(
        self, joints: Sequence[str], desired: Sequence[float], actual: Sequence[float]
    ) -> None:
        """Send feedback for the executed goals.

        Args:
            joints: names of the joints.
            desired: set-points [rad].
            actual: measured positions [rad].
        """
        message = self._action.Feedback()
        message.joint_names = list(joints)
        message.desired.positions, message.actual.positions = list(desired), list(actual)
        message.error.positions = [a - b for a, b in zip(desired, actual, strict=True)]
        for each in self._running:
            if each.goal.status is Status.ACTIVE:
                each.handle.publish_feedback(message)

    def close(self) -> None:
        """Remove the action from the graph."""
        self._server.destroy()

    def _accept(self, request: Any) -> Any:
        """Reject goals for joints with several degrees of freedom; accept all others."""
        response = self._rclpy_action.GoalResponse
        return response.REJECT if request.multi_dof_trajectory.points else response.ACCEPT

    def _cancel(self, handle: Any) -> Any:
        """Cancel the goal of a handle; a goal that has been replaced is finished already."""
        if any(each.handle is handle for each in self._running):
            self._executor.cancel()
        return self._rclpy_action.CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        """Start the trajectory, wait for its result, and return the message of the result."""
        request = handle.request
        try:
            goal = self._executor.start(
                request.trajectory,
                request.path_tolerance,
                request.goal_tolerance,
                seconds(request.goal_time_tolerance),
            )
        except CatenaryError as error:
            handle.abort()
            code = error.code if isinstance(error, TrajectoryError) else Code.INVALID_GOAL
            return self._result(code, error.message)
        running = Running(goal, handle, self._new_future())
        self._running.append(running)
        result: Result = await running.future
        if result.status is Status.SUCCEEDED:
            handle.succeed()
        elif result.status is Status.CANCELED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return self._result(result.code, result.text)

    def _result(self, code: Code, text: str) -> Any:
        message = self._action.Result()
        message.error_code, message.error_string = int(code), text
        return message


def required(module: str) -> Any:
    """Return a module of a ROS 2 installation.

    Raises:
        ConfigurationError: It is not installed.
    """
    package = module.partition(".")[0]
    try:
        return import_module(module)
    except ImportError as error:
        raise ConfigurationError(
            f"the action FollowJointTrajectory needs {package}, which is not installed",
            hint=f"apt-get install ros-$ROS_DISTRO-{package.replace('_', '-')}",
        ) from error

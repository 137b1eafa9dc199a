"""The action server with doubles of rclpy and control_msgs, and a real follower."""

from __future__ import annotations

import sys
from collections.abc import Coroutine, Generator, Sequence
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from catenary.errors import ConfigurationError
from catenary.ros2.action import FollowJointTrajectoryServer
from catenary.ros2.goal import Goal
from catenary.ros2.limits import overridden
from catenary.ros2.waypoints import Code
from tests.ros2.trajectories import JOINTS, Axes, follower, smooth, time_of


class Future:
    """Double of rclpy.task.Future."""

    def __init__(self) -> None:
        self.result: Any = None

    def set_result(self, result: Any) -> None:
        self.result = result

    def __await__(self) -> Generator[None, None, Any]:
        while self.result is None:
            yield
        return self.result


class ActionServer:
    """Double of rclpy.action.ActionServer, which keeps its callbacks."""

    def __init__(self, node: Any, kind: Any, name: str, **callbacks: Any) -> None:
        self.name, self.callbacks, self.destroyed = name, callbacks, False
        node.servers.append(self)

    def destroy(self) -> None:
        self.destroyed = True


class Feedback:
    """Double of FollowJointTrajectory.Feedback."""

    def __init__(self) -> None:
        self.desired, self.actual, self.error = (SimpleNamespace() for _ in range(3))


class Handle:
    """Double of ServerGoalHandle."""

    def __init__(self, trajectory: Any, path: Sequence[Any] = (), goal_time: float = 0.0) -> None:
        self.request = SimpleNamespace(
            trajectory=trajectory,
            multi_dof_trajectory=SimpleNamespace(points=[]),
            path_tolerance=path,
            goal_tolerance=[],
            goal_time_tolerance=time_of(goal_time),
        )
        self.is_cancel_requested = False
        self.ended = ""
        self.feedback: list[Any] = []

    def succeed(self) -> None:
        self.ended = "succeeded"

    def abort(self) -> None:
        self.ended = "aborted"

    def canceled(self) -> None:
        self.ended = "canceled"

    def publish_feedback(self, message: Any) -> None:
        self.feedback.append(message)


class Executor:
    """Follower of two axes as the executor of the goals."""

    def __init__(self) -> None:
        self.axes = Axes(follower())

    def start(
        self, trajectory: Any, path: Sequence[Any], goal: Sequence[Any], goal_time: float
    ) -> Goal:
        tolerances = overridden(self.axes.it.tolerances, JOINTS, path, goal, goal_time)
        found: Goal = self.axes.accept(trajectory, tolerances)
        return found

    def cancel(self) -> None:
        self.axes.it.cancel(self.axes.now)


class Client:
    """Owns the server, and sends goals as rclpy would."""

    def __init__(self) -> None:
        self.node = SimpleNamespace(servers=[])
        self.executor = Executor()
        self.it = FollowJointTrajectoryServer(self.node, "follow", self.executor)
        self.callbacks = self.node.servers[0].callbacks
        self.waiting: list[tuple[Coroutine[Any, Any, Any], list[Any]]] = []

    def send(self, handle: Handle) -> list[Any]:
        assert self.callbacks["goal_callback"](handle.request) == "accept"
        results: list[Any] = []
        self.waiting.append((self.callbacks["execute_callback"](handle), results))
        self.proceed()
        return results

    def cancel(self, handle: Handle) -> None:
        assert self.callbacks["cancel_callback"](handle) == "accept cancel"
        handle.is_cancel_requested = True

    def run(self, duration: float) -> None:
        self.executor.axes.run(duration)
        self.it.step()
        self.proceed()

    def proceed(self) -> None:
        left = []
        for coroutine, results in self.waiting:
            try:
                coroutine.send(None)
            except StopIteration as end:
                results.append(end.value)
            else:
                left.append((coroutine, results))
        self.waiting = left


def module(name: str, **members: Any) -> ModuleType:
    made = ModuleType(name)
    vars(made).update(members)
    return made


@pytest.fixture
def client(monkeypatch: pytest.MonkeyPatch) -> Client:
    action = SimpleNamespace(Result=SimpleNamespace, Feedback=Feedback)
    doubles = [
        module("control_msgs"),
        module("control_msgs.action", FollowJointTrajectory=action),
        module("rclpy"),
        module(
            "rclpy.action",
            ActionServer=ActionServer,
            GoalResponse=SimpleNamespace(ACCEPT="accept", REJECT="reject"),
            CancelResponse=SimpleNamespace(ACCEPT="accept cancel"),
        ),
        module("rclpy.task", Future=Future),
    ]
    for double in doubles:
        monkeypatch.setitem(sys.modules, double.__name__, double)
    return Client()


def test_a_goal_succeeds(client: Client) -> None:
    handle = Handle(smooth(1.0, 0.5, -0.5))
    results = client.send(handle)
    client.run(0.5)
    assert not results
    client.run(0.7)
    assert handle.ended == "succeeded"
    assert (results[0].error_code, results[0].error_string) == (0, "goal reached")


def test_a_refused_trajectory_is_aborted_with_its_code(client: Client) -> None:
    handle = Handle(smooth(0.1, 0.5, -0.5))
    results = client.send(handle)
    assert handle.ended == "aborted"
    assert results[0].error_code == Code.INVALID_GOAL
    assert "velocity of a" in results[0].error_string


def test_a_cancelled_goal_ends_as_canceled(client: Client) -> None:
    handle = Handle(smooth(1.0, 0.5, -0.5))
    results = client.send(handle)
    client.run(0.5)
    client.cancel(handle)
    client.run(0.5)
    assert handle.ended == "canceled"
    assert results[0].error_string == "canceled"
    assert not client.executor.axes.velocity.any()


def test_a_replaced_goal_is_aborted_and_its_cancel_changes_nothing(client: Client) -> None:
    first, second = Handle(smooth(1.0, 0.5, 0)), Handle(smooth(1.0, 0.2, 0))
    results = client.send(first)
    client.run(0.3)
    client.send(second)
    client.run(0.1)
    assert first.ended == "aborted"
    assert results[0].error_string == "replaced by a newer trajectory"
    client.cancel(first)
    client.run(1.2)
    assert second.ended == "succeeded"


def test_the_tolerances_of_the_goal_count(client: Client) -> None:
    path = [SimpleNamespace(name="b", position=0.05)]
    handle = Handle(smooth(1.0, 0.5, -0.5), path)
    results = client.send(handle)
    client.executor.axes.error = 0.2
    client.run(0.1)
    assert handle.ended == "aborted"
    assert results[0].error_code == Code.PATH_TOLERANCE_VIOLATED


def test_a_tolerance_of_an_unknown_joint_is_refused(client: Client) -> None:
    results = client.send(Handle(smooth(1, 0, 0), [SimpleNamespace(name="c", position=0.1)]))
    assert results[0].error_code == Code.INVALID_JOINTS


def test_goals_for_joints_with_several_degrees_of_freedom_are_rejected(client: Client) -> None:
    handle = Handle(smooth(1.0, 0, 0))
    handle.request.multi_dof_trajectory.points.append(object())
    assert client.callbacks["goal_callback"](handle.request) == "reject"


def test_feedback_goes_to_the_active_goal(client: Client) -> None:
    handle = Handle(smooth(1.0, 0.5, -0.5))
    client.send(handle)
    client.it.feedback(JOINTS, [0.5, 1.0], [0.25, 1.0])
    client.run(1.2)
    client.it.feedback(JOINTS, [0.0, 0.0], [0.0, 0.0])
    [message] = handle.feedback
    assert message.joint_names == list(JOINTS)
    assert message.desired.positions == [0.5, 1.0]
    assert message.actual.positions == [0.25, 1.0]
    assert message.error.positions == [0.25, 0.0]


def test_close_removes_the_action(client: Client) -> None:
    client.it.close()
    assert client.node.servers[0].destroyed


def test_without_control_msgs_the_error_names_the_package() -> None:
    with pytest.raises(ConfigurationError, match="control_msgs, which is not installed"):
        FollowJointTrajectoryServer(None, "follow", Executor())

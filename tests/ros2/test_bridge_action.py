"""The action FollowJointTrajectory of a bridge, with a graph in memory."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from catenary.errors import CatenaryError
from catenary.ros2.config import Commands, Config, Trajectory
from catenary.ros2.goal import Goal, Status
from catenary.ros2.trajectory import TrajectoryError
from catenary.ros2.waypoints import Code
from tests.ros2.bridges import Rig, rig
from tests.ros2.memory_backend import MemoryAction
from tests.ros2.test_bridge import enable, trajectory


def action_of(running: Rig) -> MemoryAction:
    return running.backend.action


def start(running: Rig, offset: float, *path: SimpleNamespace) -> Goal:
    return action_of(running).executor.start(trajectory(running, offset), path, (), 0.0)


def test_a_goal_moves_the_axes_and_succeeds() -> None:
    with rig() as running:
        enable(running)
        end = running.arm.actual.position[0] + 0.1
        goal = start(running, 0.1)
        assert running.until(lambda: goal.finished)
        assert goal.status is Status.SUCCEEDED
        assert running.arm.actual.position[0] == pytest.approx(end, abs=0.01)
        assert action_of(running).name == "~/follow_joint_trajectory"
        assert action_of(running).steps > 0


def test_feedback_has_the_set_points_and_the_measured_positions() -> None:
    with rig() as running:
        enable(running)
        goal = start(running, 0.1)
        assert running.until(lambda: goal.finished)
        joints, desired, actual = action_of(running).sent[0]
        assert list(joints) == list(running.arm.names)
        assert len(desired) == len(actual) == len(running.arm.names)


def test_a_cancelled_goal_decelerates_and_holds() -> None:
    with rig() as running:
        enable(running)
        first = running.arm.actual.position[0]
        goal = start(running, 0.5)
        assert running.until(lambda: running.arm.actual.position[0] > first + 0.05)
        action_of(running).executor.cancel()
        running.step()
        assert goal.status is Status.CANCELED
        assert running.until(lambda: abs(running.arm.actual.velocity).max() < 1e-3)
        assert running.arm.actual.position[0] < first + 0.4
        assert running.last_report == ""


def test_a_trajectory_of_the_topic_replaces_the_goal() -> None:
    with rig() as running:
        enable(running)
        goal = start(running, 0.1)
        running.step()
        running.backend.deliver("joint_trajectory", trajectory(running, 0.0))
        assert running.until(lambda: goal.finished)
        assert goal.status is Status.PREEMPTED


def test_a_goal_replaces_an_older_message() -> None:
    with rig() as running:
        enable(running)
        running.backend.deliver("joint_trajectory", trajectory(running, -0.1))
        running.backend.spin_once(0.0)
        goal = start(running, 0.1)
        assert running.until(lambda: goal.finished)
        assert goal.status is Status.SUCCEEDED


def test_a_path_tolerance_of_the_goal_counts() -> None:
    with rig() as running:
        enable(running)
        name = running.arm.names[0]
        goal = start(running, 0.3, SimpleNamespace(name=name, position=1e-9))
        assert running.until(lambda: goal.finished)
        assert goal.result is not None
        assert goal.result.code == Code.PATH_TOLERANCE_VIOLATED


def test_a_refused_goal_moves_nothing() -> None:
    with rig() as running:
        enable(running)
        before = running.arm.target.position.copy()
        with pytest.raises(TrajectoryError, match="velocity of"):
            start(running, 50.0)
        running.step(50)
        assert (running.arm.target.position == before).all()
        assert running.last_report.startswith("action: ")
        assert running.bridge.reports.counts["refused commands"] == 1


def test_a_goal_for_a_disabled_axis_is_refused() -> None:
    with rig() as running:
        running.step()
        running.arm.disable()
        assert running.until(lambda: not running.arm.enabled.any())
        with pytest.raises(CatenaryError, match="is not enabled"):
            start(running, 0.1)


def test_the_end_of_the_loop_ends_the_goal() -> None:
    with rig() as running:
        enable(running)
        goal = start(running, 0.3)
        running.step()
        running.loop.close()
        running.bridge.step()
        running.bridge._source._news_at = 0.0  # lets 1 s without a cycle pass
        running.spin()
        running.spin()
        assert goal.status is Status.ABORTED
        with pytest.raises(CatenaryError, match="there is no running loop"):
            start(running, 0.1)


@pytest.mark.parametrize(
    "commands", [Commands(trajectory=Trajectory(action="")), Commands(on=False)]
)
def test_the_action_can_be_switched_off(commands: Commands) -> None:
    with rig(Config(commands=commands)) as running:
        assert running.bridge._action is None


def test_close_removes_the_action() -> None:
    with rig() as running:
        action = action_of(running)
        assert not action.closed
    assert action.closed


def test_notes_are_shown_once() -> None:
    shown: list[str] = []
    with rig(services=False) as running:
        stop = SimpleNamespace(is_set=lambda: True)
        running.bridge.run(stop, shown.append)  # type: ignore[arg-type]
    assert "no actions" in shown

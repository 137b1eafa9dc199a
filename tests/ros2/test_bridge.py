"""The bridge between a loop in virtual time and a graph in memory."""

from __future__ import annotations

import math

import numpy as np
import pytest

import catenary as cat
from catenary.errors import ConfigurationError, ResponseTimeout, ShareError
from catenary.ros2 import messages
from catenary.ros2.backend import COMMAND
from catenary.ros2.bridge import Bridge
from catenary.ros2.config import Clock, Commands, Config, Diagnostics, Forward, Point, ProcessData
from catenary.ros2.config_file import PROFILES, make_config
from catenary.ros2.readings import process_value
from catenary.ros2.requests import Requests
from tests.ros2.bridges import Rig, rig
from tests.ros2.memory_backend import MemoryBackend

FORWARD = Config(commands=Commands(forward=Forward(on=True, timeout=0.02)))


def trajectory(rig: Rig, offset: float, seconds: float = 0.5) -> messages.JointTrajectory:
    goal = [position + offset for position in rig.arm.actual.position]
    point = messages.JointTrajectoryPoint(
        positions=goal, time_from_start=messages.Duration.from_seconds(seconds)
    )
    return messages.JointTrajectory(joint_names=list(rig.arm.names), points=[point])


def enable(rig: Rig) -> None:
    assert rig.until(lambda: bool(rig.arm.enabled.all()))


def test_joint_states_have_the_values_and_the_time_of_a_cycle() -> None:
    with rig(Config(joints={})) as running:
        running.step()
        [*_, message] = running.sent("joint_states")
        with cat.attach(running.name) as reader:
            row = reader.read()
        assert list(message.name) == list(running.arm.names)
        assert message.position == row["position"].tolist()
        assert message.velocity == row["velocity"].tolist()
        assert message.effort == row["torque"].tolist()
        assert message.header.stamp.to_ns() == row["scheduled_ns"]


def test_a_cycle_is_published_once() -> None:
    with rig() as running:
        running.step()
        count = len(running.sent("joint_states"))
        running.spin()
        assert len(running.sent("joint_states")) == count


def test_virtual_time_is_published_as_the_clock() -> None:
    with rig() as running:
        running.step()
        [*_, clock] = running.sent("/clock")
        [*_, states] = running.sent("joint_states")
        assert clock.clock == states.header.stamp
        assert running.backend.publishers["/clock"].qos.reliability == "best_effort"


def test_the_clock_can_be_switched_off() -> None:
    with rig(Config(clock=Clock(on=False))) as running:
        assert "/clock" not in running.backend.publishers


def test_joints_are_renamed() -> None:
    with rig() as running:
        first = running.arm.names[0]
        config = Config(joints={first: "shoulder"})
        with Bridge(running.name, MemoryBackend(), config) as bridge:
            running.bridge = bridge
            running.backend = bridge._backend
            running.step()
            assert running.sent("joint_states")[-1].name[0] == "shoulder"


def test_diagnostics_name_loop_axes_devices_and_cables() -> None:
    config = Config(diagnostics=make_config({"diagnostics": {"rate": 1e4}}).diagnostics)
    with rig(config) as running:

        def names() -> set[str]:
            found = running.sent("/diagnostics")
            return {each.name.partition(": ")[2] for each in found[-1].status} if found else set()

        assert running.until(lambda: "cables of device 1" in names())
        assert names() >= {"bridge", "loop", "device 0", *running.arm.names}
        first, last = (
            {each.name: each.level for each in running.sent("/diagnostics")[k].status}
            for k in (0, -1)
        )
        assert first[f"{running.name}: loop"] == messages.DiagnosticStatus.OK
        levels = last
        assert levels[f"{running.name}: bridge"] == messages.DiagnosticStatus.OK


def test_a_mismatch_of_qos_is_part_of_the_diagnostics() -> None:
    with rig() as running:
        running.backend.incompatible.append("/joint_trajectory: reliability of /teleop")
        running.bridge._publishing._diagnostics_at = 0.0
        running.step()
        status = running.sent("/diagnostics")[-1].status[0]
        assert status.level == messages.DiagnosticStatus.WARN
        assert status.message == "/joint_trajectory: reliability of /teleop"


def test_a_mismatch_of_qos_is_shown_once() -> None:
    shown: list[str] = []
    with rig() as running:
        running.backend.incompatible.append("/joint_trajectory: reliability of /teleop")
        for _ in range(2):
            running.bridge._show(shown.append)
    assert shown == ["/joint_trajectory: reliability of /teleop"]


def test_process_data_have_their_types() -> None:
    topics = (
        ProcessData(field="position[1]", topic="p"),
        ProcessData(field="number", topic="n", type="int64"),
        ProcessData(field="enabled[0]", topic="e", type="bool"),
        ProcessData(field="commanded_torque", topic="t", type="float64_array"),
    )
    with rig(Config(process_data=topics)) as running:
        running.step()
        assert running.sent("p")[-1] == messages.Float64(float(running.arm.actual.position[1]))
        with cat.attach(running.name) as reader:
            assert running.sent("n")[-1].data == reader.number
        assert running.sent("e")[-1] == messages.Bool(bool(running.arm.enabled[0]))
        assert len(running.sent("t")[-1].data) == 2


def test_large_integers_are_exact() -> None:
    row = np.zeros(1, [("time_ns", "i8")])[0]
    row["time_ns"] = 1_700_000_000_000_000_001
    config = ProcessData(field="time_ns", topic="t", type="int64")
    assert process_value(config, row) == messages.Int64(1_700_000_000_000_000_001)


def test_a_missing_field_is_reported_and_not_published() -> None:
    with rig(Config(process_data=(ProcessData(field="nothing", topic="p"),))) as running:
        running.step()
        assert running.sent("p") == []
        running.bridge._publishing._diagnostics_at = 0.0
        running.step()
        texts = [each.message for each in running.sent("/diagnostics")[-1].status]
        assert any("there is no field 'nothing'" in text for text in texts)
        assert running.last_report.startswith("p: there is no field 'nothing'")
        assert running.bridge.reports.counts["topics without data"] == 1


def test_two_topics_with_one_name_are_refused() -> None:
    process_data = (ProcessData(field="position[0]", topic="joint_states"),)
    with rig() as running, pytest.raises(ConfigurationError, match="published twice"):
        Bridge(running.name, MemoryBackend(), Config(process_data=process_data))


def test_a_missing_share_is_an_error_at_the_start() -> None:
    with pytest.raises(ShareError, match="there is no share"):
        Bridge("test-gone", MemoryBackend(), Config())


def test_a_trajectory_moves_the_axes_to_its_end() -> None:
    with rig() as running:
        enable(running)
        message = trajectory(running, 0.2)
        running.backend.deliver("joint_trajectory", message)
        running.step()
        assert running.bridge._commands.active
        assert running.until(lambda: not running.bridge._commands.active)
        with cat.attach(running.name) as reader:
            commanded = reader.read()["commanded_position"]
        np.testing.assert_allclose(commanded, message.points[0].positions, atol=1e-5)
        assert not running.bridge.reports.texts


def test_positions_advance_in_every_cycle_between_two_commands() -> None:
    with rig() as running:
        running.backend.deliver("joint_trajectory", trajectory(running, 0.2, 1.0))
        targets = []
        for cycle in range(600):
            next(running.loop)
            running.share.apply(running.arm)
            targets.append(running.arm.target.position[0])
            if cycle % 4 == 0:
                running.spin()
        steps = np.diff(targets)
        moving = steps[np.flatnonzero(steps)[0] :]
        assert len(moving) > 500
        np.testing.assert_allclose(moving, moving[0], rtol=1e-6)  # a straight line


def test_a_trajectory_too_fast_is_refused_and_nothing_moves() -> None:
    with rig() as running:
        enable(running)
        before = running.arm.actual.position.copy()
        running.backend.deliver("joint_trajectory", trajectory(running, 2.0, 0.1))
        running.step(50)
        assert "joint_trajectory" not in running.last_report  # the report names the command
        assert "velocity of" in running.last_report
        assert running.bridge.reports.counts["refused commands"] == 1
        np.testing.assert_allclose(running.arm.actual.position, before, atol=1e-6)


def test_a_trajectory_refused_during_a_stream_leaves_no_start_behind() -> None:
    with rig(FORWARD) as running:
        enable(running)
        start = running.arm.actual.position.copy()
        for step in range(60):
            data = (start + step * 0.002).tolist()
            running.backend.deliver("forward_commands", messages.Float64MultiArray(data=data))
            running.step()
            if step == 10:
                unfit = trajectory(running, 9.0, 0.1)
                running.backend.deliver("joint_trajectory", unfit)
                running.step()
                assert "velocity of" in running.last_report
        running.step(50)
        assert not running.bridge._commands.active
        before = running.arm.target.position.copy()
        running.backend.deliver("joint_trajectory", trajectory(running, 0.1))
        running.step()
        running.step()
        assert running.bridge._commands.active
        assert (abs(running.arm.target.position - before) < 0.01).all()


def test_a_disabled_axis_refuses_commands() -> None:
    with rig() as running:
        enable(running)
        running.arm.disable()
        assert running.until(lambda: not running.arm.enabled.any())
        running.backend.deliver("joint_trajectory", trajectory(running, 0.1))
        running.step()
        assert "is not enabled" in running.last_report


def test_an_axis_that_is_disabled_ends_the_motion() -> None:
    with rig() as running:
        enable(running)
        running.backend.deliver("joint_trajectory", trajectory(running, 0.5, 2.0))
        running.step(20)
        running.arm.disable()
        assert running.until(lambda: not running.bridge._commands.active)
        assert "is not enabled" in running.last_report


def test_set_points_are_forwarded_until_their_time_out() -> None:
    with rig(FORWARD) as running:
        enable(running)
        start = running.arm.actual.position.copy()
        goal = (start + 0.01).tolist()
        for _ in range(20):
            running.backend.deliver("forward_commands", messages.Float64MultiArray(data=goal))
            running.step()
        np.testing.assert_allclose(running.arm.target.position, goal)
        running.step(30)
        assert not running.bridge._commands.active
        assert running.last_report == ("the stream of set-points has ended: no message in time")


def test_a_step_in_a_stream_of_positions_is_limited_in_velocity() -> None:
    with rig(FORWARD) as running:
        enable(running)
        start = running.arm.actual.position.copy()
        for _ in range(10):
            far = messages.Float64MultiArray(data=(start + 1.0).tolist())
            running.backend.deliver("forward_commands", far)
            running.step()
        moved = running.arm.target.position - start
        assert (moved > 0).all()
        assert (moved <= 2.0 * 0.02 + 1e-9).all()  # 2 rad/s for 20 ms


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ([0.0], "1 values for 2 joints"),
        ([math.nan, 0.0], "values that are not finite: [nan, 0.0]"),
        ([math.inf, 0.0], "values that are not finite: [inf, 0.0]"),
        ([5.0, 0.0], "position 5 rad for"),
    ],
)
def test_a_bad_set_point_is_refused(data: list[float], reason: str) -> None:
    with rig(FORWARD, position_min=-3.0, position_max=3.0) as running:
        enable(running)
        running.backend.deliver("forward_commands", messages.Float64MultiArray(data=data))
        running.step()
        assert reason in running.last_report
        assert not running.bridge._commands.active


def test_velocities_need_a_velocity_mode() -> None:
    config = Config(commands=Commands(forward=Forward(on=True, quantity="velocity")))
    with rig(config) as running:
        enable(running)
        running.backend.deliver("forward_commands", messages.Float64MultiArray(data=[0.1, 0.1]))
        running.step()
        assert "velocity commands need CSV, PV" in running.last_report


def test_velocities_move_axes_in_csv() -> None:
    config = Config(commands=Commands(forward=Forward(on=True, quantity="velocity")))
    with rig(config, mode="csv") as running:
        enable(running)
        running.backend.deliver("forward_commands", messages.Float64MultiArray(data=[0.1, -0.1]))
        for _ in range(3):
            running.step(10)
        assert running.arm.target.velocity.tolist() == [0.1, -0.1]


def test_only_the_newest_command_of_a_flood_counts() -> None:
    with rig(FORWARD) as running:
        enable(running)
        start = running.arm.actual.position.copy()
        assert running.backend.subscriptions["forward_commands"][1] == COMMAND
        for number in range(10_000):
            data = (start + number * 1e-9).tolist()
            running.backend.deliver("forward_commands", messages.Float64MultiArray(data=data))
        running.step()
        follower = running.bridge._commands._followers["forward"]
        assert follower._command._wanted.tolist() == data


def test_axes_leased_by_another_client_refuse_commands() -> None:
    with rig() as running:
        enable(running)
        with cat.attach(running.name) as other, other.lease(for_=10.0):
            running.backend.deliver("joint_trajectory", trajectory(running, 0.1))
            running.step()
        assert "is leased to" in running.last_report


def test_a_lost_lease_ends_the_motion_and_is_reported() -> None:
    with rig() as running:
        enable(running)
        running.backend.deliver("joint_trajectory", trajectory(running, 0.5, 2.0))
        running.step(20)
        running.bridge._commands._lease.release()
        running.spin()
        assert running.bridge.reports.counts["leases lost"] == 1
        assert not running.bridge._commands.active


def test_the_axes_hold_when_the_bridge_closes() -> None:
    with rig() as running:
        enable(running)
        running.backend.deliver("joint_trajectory", trajectory(running, 0.5, 2.0))
        running.step(50)
        running.step()
        running.bridge.close()
        next(running.loop)
        assert running.share.apply(running.arm)
        held = running.arm.target.position.copy()
        for _ in range(100):
            next(running.loop)
            running.share.apply(running.arm)
        np.testing.assert_allclose(running.arm.actual.position, held, atol=1e-3)
        assert running.backend.closed


def test_a_returned_loop_is_published_and_commanded_again() -> None:
    with rig() as running:
        running.step()
        running.loop.close()
        running.spin()
        running.bridge._source._news_at = 0.0  # lets 1 s without a cycle pass
        running.spin()
        assert running.bridge._source.reason == "the loop has ended"
        count = len(running.sent("joint_states"))
        with cat.Loop(running.arm, period=1e-3, sink=running.share) as loop:
            running.loop = loop
            next(loop)
            running.bridge._source._retry_at = 0.0
            running.step()
            running.step()
            assert len(running.sent("joint_states")) > count
            assert running.bridge._commands is not None


def test_the_profile_rdda_streams_positions_and_publishes_efforts() -> None:
    assert "rdda" in PROFILES
    with rig(make_config({"profile": "rdda"})) as running:
        enable(running)
        goal = (running.arm.actual.position + 0.001).tolist()
        running.backend.deliver("joint_cmds", messages.JointTrajectoryPoint(positions=goal))
        for _ in range(3):
            running.step()
        np.testing.assert_allclose(running.arm.target.position, goal)
        assert len(running.sent("joint_stats")[-1].position) == 2
        assert len(running.sent("ctrl_stats")[-1].data) == 2


def test_a_backend_without_services_is_noted() -> None:
    with rig(services=False) as running:
        assert running.bridge.reports.notes == [
            "services and parameters need rclpy; this backend has topics only",
            "no actions",
        ]


def test_unknown_limits_refuse_commands_and_are_requested_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def silent(requests: Requests) -> list[object]:
        raise ResponseTimeout("the program did not answer")

    with monkeypatch.context() as patch:
        patch.setattr(Requests, "axes", silent)
        with rig(Config(diagnostics=Diagnostics(on=False))) as running:
            enable(running)
            running.backend.deliver("joint_trajectory", trajectory(running, 0.1))
            running.step()
            assert running.last_report == "trajectory: the program did not answer"
            patch.undo()
            running.bridge._prepare_at = 0.0  # lets the time until the next request pass
            running.backend.deliver("joint_trajectory", trajectory(running, 0.1))
            running.step()
            assert running.bridge._commands.active


def test_commands_for_unknown_axes_are_reported() -> None:
    config = Config(commands=Commands(axes=("elbow",), point=Point(on=True)))
    with rig(config) as running:
        running.step()
        assert "there is no axis 'elbow'" in running.last_report
        assert running.sent("joint_states")

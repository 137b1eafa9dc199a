"""Trajectories are followed, replaced, cancelled, aborted and refused as FollowJointTrajectory."""

from __future__ import annotations

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.ros2.goal import AxisStates, Status
from catenary.ros2.limits import Tolerances
from catenary.ros2.trajectory import FollowerOptions
from catenary.ros2.waypoints import Code, TrajectoryError
from tests.ros2.trajectories import JOINTS, STEP, Axes, follower, point, smooth, trajectory

FINE = 1e-9


def refused(axes: Axes, message: object) -> TrajectoryError:
    with pytest.raises(TrajectoryError) as caught:
        axes.accept(message)
    return caught.value


def test_a_trajectory_ends_at_rest_at_its_last_point_and_succeeds() -> None:
    axes = Axes(follower())
    goal = axes.accept(smooth(1.0, 0.5, -0.5))
    axes.run(0.5)
    assert axes.commanded == pytest.approx([0.25, -0.25])
    assert axes.it.goal is goal
    axes.run(0.6)
    assert axes.commanded == pytest.approx([0.5, -0.5])
    assert goal.result == (Status.SUCCEEDED, Code.SUCCESSFUL, "goal reached")
    assert axes.it.result is goal.result
    assert not axes.it.active


def test_the_joints_may_be_in_another_order() -> None:
    axes = Axes(follower())
    axes.accept(trajectory(point(1.0, [0.3, 0.1], [0, 0]), joints=("b", "a")))
    axes.run(1.1)
    assert axes.commanded == pytest.approx([0.1, 0.3])


def test_without_a_trajectory_the_axes_hold_where_they_are_commanded() -> None:
    axes = Axes(follower())
    axes.commanded = np.array([0.4, 0.2])
    axes.run(0.1)
    assert axes.commanded == pytest.approx([0.4, 0.2])
    assert not axes.it.active


@pytest.mark.parametrize(
    ("message", "code", "text"),
    [
        (trajectory(point(1, [0, math.nan])), Code.INVALID_GOAL, "positions that are not finite"),
        (trajectory(*[point(1, [0, 0])] * 10_001), Code.INVALID_GOAL, "10001 points; the limit is"),
        (trajectory(point(1, [0, 0], [0, math.inf])), Code.INVALID_GOAL, "not finite"),
        (trajectory(point(1, [0, 0]), joints=("a", "c")), Code.INVALID_JOINTS, "unknown joint 'c'"),
        (trajectory(point(1, [0, 0]), joints=("a", "a")), Code.INVALID_JOINTS, "given twice"),
        (trajectory(point(1, [0]), joints=("a",)), Code.INVALID_JOINTS, "joints are missing: b"),
        (trajectory(point(1, [0]), joints=()), Code.INVALID_JOINTS, "joints are missing"),
        (trajectory(point(1, [0, 0, 0])), Code.INVALID_GOAL, "3 positions for 2 joints"),
        (trajectory(point(1, [0, 0], [0])), Code.INVALID_GOAL, "1 velocities for 2 joints"),
        (trajectory(point(1)), Code.INVALID_GOAL, "no positions"),
        (trajectory(point(1, [0, 0], (), [0, 0])), Code.INVALID_GOAL, "without velocities"),
        (trajectory(point(1, [0, 0], effort=[1, 1])), Code.INVALID_GOAL, "efforts"),
        (trajectory(point(1, [0, 0]), point(1, [1, 1])), Code.INVALID_GOAL, "point 1 is at 1 s"),
        (trajectory(point(2, [0, 0]), point(1, [1, 1])), Code.INVALID_GOAL, "point 1 is at 1 s"),
        (trajectory(point(-1, [0, 0])), Code.INVALID_GOAL, "before the start"),
        (trajectory(point(1, [0, 0], [0, 0.1])), Code.INVALID_GOAL, "last velocity"),
        (trajectory(point(0, [0, 0])), Code.INVALID_GOAL, "no point is after the start"),
        (trajectory(point(0, [0.1, 0]), point(1, [0, 0])), Code.INVALID_GOAL, "at time 0 is 0.1"),
        (trajectory(point(0.1, [0.5, 0])), Code.INVALID_GOAL, "velocity of a reaches 5 rad/s"),
        (smooth(1.0, 0, -1.5), Code.INVALID_GOAL, "velocity of b reaches -2.25"),
        (smooth(10.0, 3.1, 0), Code.INVALID_GOAL, "position of a reaches 3.1 rad; the limit is 3"),
        (smooth(1.0, 0.5, 0, stamp=98.0), Code.OLD_HEADER_TIMESTAMP, "in the past"),
        (smooth(1.0, 0.5, 0, stamp=161.0), Code.INVALID_GOAL, "starts in 61.000 s"),
    ],
)
def test_a_bad_trajectory_is_refused_with_code_and_reason(
    message: object, code: Code, text: str
) -> None:
    axes = Axes(follower())
    error = refused(axes, message)
    assert error.code == code
    assert text in str(error)
    axes.run(0.1)
    assert not axes.commanded.any()


def test_a_refused_trajectory_leaves_the_current_one_unchanged() -> None:
    axes, judge = Axes(follower()), Axes(follower())
    for each in (axes, judge):
        each.accept(smooth(1.0, 0.5, -0.5))
        each.run(0.5)
    refused(axes, trajectory(point(0.01, [3, 3])))
    for each in (axes, judge):
        each.run(0.6)
    assert np.array_equal(axes.positions, judge.positions)


def test_an_overshoot_between_the_points_beyond_a_limit_is_refused() -> None:
    axes = Axes(follower(position_max=0.5))
    message = trajectory(point(1, [0.49, 0], [1.0, 0]), point(2, [0.49, 0], [0, 0]))
    assert "position of a reaches 0.6" in str(refused(axes, message))


def test_accelerations_beyond_the_limit_are_refused() -> None:
    axes = Axes(follower(acceleration=2.9))
    assert "acceleration of a reaches -3 rad/s²" in str(refused(axes, smooth(1.0, 0.5, 0)))


def test_accelerations_make_the_motion_quintic() -> None:
    axes = Axes(follower())
    axes.accept(trajectory(point(1, [0.8, 0], [0, 0], [0, 0])))
    axes.run(0.25)
    s = 0.25  # minimum jerk: Flash and Hogan, 1985
    assert axes.commanded[0] == pytest.approx(0.8 * (10 * s**3 - 15 * s**4 + 6 * s**5))


def test_positions_only_are_linear() -> None:
    axes = Axes(follower())
    axes.accept(trajectory(point(1, [1.0, 0]), point(2, [1.5, 0])))
    axes.run(0.5)
    assert axes.velocity == pytest.approx([1.0, 0])
    axes.run(1.0)
    assert axes.velocity == pytest.approx([0.5, 0])


def test_a_replacement_continues_with_position_and_velocity() -> None:
    axes = Axes(follower())
    first = axes.accept(smooth(1.0, 1.0, 0))
    axes.run(0.5)
    position, velocity = axes.commanded, axes.velocity
    second = axes.accept(smooth(1.0, 0.5, 0.2))
    assert first.status is Status.PREEMPTED
    axes.run(STEP)
    assert axes.commanded == pytest.approx(position + velocity * STEP, abs=2e-3)
    assert axes.velocity == pytest.approx(velocity, abs=0.15)
    axes.run(1.1)
    assert second.status is Status.SUCCEEDED
    assert axes.commanded == pytest.approx([0.5, 0.2])


def test_a_later_start_keeps_the_current_trajectory_until_then() -> None:
    axes = Axes(follower())
    first = axes.accept(smooth(1.0, 1.0, 0))
    second = axes.accept(smooth(1.0, 0, 0, stamp=100.5))
    assert second.status is Status.WAITING
    axes.run(0.5 - STEP)
    assert first.status is Status.ACTIVE
    before = axes.velocity
    axes.run(2 * STEP)
    assert (first.status, second.status) == (Status.PREEMPTED, Status.ACTIVE)
    assert axes.velocity == pytest.approx(before, abs=0.2)
    axes.run(1.1)
    assert second.status is Status.SUCCEEDED


def test_a_newer_later_start_replaces_the_older_one() -> None:
    axes = Axes(follower())
    older = axes.accept(smooth(1.0, 1.0, 0, stamp=101))
    newer = axes.accept(smooth(1.0, 0, 1.0, stamp=102))
    assert (older.status, newer.status) == (Status.PREEMPTED, Status.WAITING)


def test_points_in_the_past_are_discarded() -> None:
    axes = Axes(follower())
    points = point(0.5, [2.9, 2.9], [0, 0]), point(1.5, [0.5, 0], [0, 0])
    axes.accept(trajectory(*points, stamp=99.0))  # the first was due 0.5 s ago
    axes.run(0.5)
    assert axes.commanded == pytest.approx([0.5, 0])
    assert abs(np.array(axes.positions)).max() <= 0.5 + FINE


def test_a_past_start_with_too_little_time_left_is_refused() -> None:
    axes = Axes(follower())
    message = smooth(1.0, 0.5, 0, stamp=99.1)
    assert "velocity of a reaches" in str(refused(axes, message))


def test_cancel_decelerates_within_the_limit_and_holds() -> None:
    axes = Axes(follower(deceleration=4.0))
    goal = axes.accept(smooth(1.0, 1.0, -0.5))
    axes.run(0.5)
    axes.it.cancel(axes.now)
    assert goal.result == (Status.CANCELED, Code.SUCCESSFUL, "canceled")
    assert axes.it.active
    begin, speed = axes.commanded, axes.velocity
    axes.run(1.0)
    assert not axes.it.active
    assert not axes.velocity.any()
    assert axes.commanded == pytest.approx(begin + speed * (1.5 / 4.0) / 2)
    slopes = np.diff(np.array(axes.velocities)[50:], axis=0) / STEP
    assert abs(slopes).max() <= 4.0 + 1e-6


def test_cancel_without_a_goal_changes_nothing() -> None:
    axes = Axes(follower())
    axes.it.cancel(axes.now)
    axes.run(0.1)
    assert axes.it.result is None
    assert not axes.commanded.any()


def test_a_stop_ends_before_a_position_limit() -> None:
    axes = Axes(follower(deceleration=0.5, position_max=1.0))
    axes.accept(smooth(1.0, 1.0, 0))
    axes.run(0.5)
    axes.it.cancel(axes.now)
    axes.run(5.0)
    assert np.array(axes.positions).max() <= 1.0 + FINE


def test_an_empty_trajectory_stops_the_axes() -> None:
    axes = Axes(follower())
    first = axes.accept(smooth(1.0, 1.0, 0))
    axes.run(0.5)
    stop = axes.accept(trajectory())
    assert first.status is Status.PREEMPTED
    axes.run(1.0)
    assert stop.status is Status.SUCCEEDED
    assert axes.commanded[0] < 1.0


def test_an_empty_trajectory_at_rest_succeeds_at_once() -> None:
    axes = Axes(follower())
    assert axes.accept(trajectory()).status is Status.SUCCEEDED


def test_a_path_error_beyond_the_tolerance_aborts() -> None:
    axes = Axes(follower(Tolerances.of(2, path=[0.1, 0.05])))
    goal = axes.accept(smooth(1.0, 1.0, 0.5))
    axes.run(0.3)
    axes.error = 0.06
    axes.run(STEP)
    assert goal.result is not None
    assert goal.result.code == Code.PATH_TOLERANCE_VIOLATED
    assert "path tolerance of b: the error is 0.05" in goal.result.text
    axes.run(1.0)
    assert not axes.velocity.any()


def test_a_measured_nan_aborts() -> None:
    axes = Axes(follower())
    goal = axes.accept(smooth(1.0, 1.0, 0.5))
    axes.error = math.nan
    axes.run(STEP)
    assert goal.status is Status.ABORTED


def test_a_goal_error_aborts_after_the_goal_time() -> None:
    axes = Axes(follower(Tolerances.of(2, goal=0.01, goal_time=0.2)), error=0.02)
    goal = axes.accept(smooth(1.0, 1.0, 0))
    axes.run(1.15)
    assert goal.status is Status.ACTIVE
    axes.run(0.1)
    assert goal.result is not None
    assert goal.result.code == Code.GOAL_TOLERANCE_VIOLATED


def test_a_goal_reached_within_the_goal_time_succeeds() -> None:
    axes = Axes(follower(Tolerances.of(2, goal=0.01, goal_time=0.2)), error=0.02)
    goal = axes.accept(smooth(1.0, 1.0, 0))
    axes.run(1.1)
    axes.error = 0.005
    axes.run(STEP)
    assert goal.status is Status.SUCCEEDED


def test_without_a_goal_time_the_goal_waits() -> None:
    axes = Axes(follower(Tolerances.of(2, goal=0.01)), error=0.02)
    goal = axes.accept(smooth(1.0, 1.0, 0))
    axes.run(30.0)
    assert goal.status is Status.ACTIVE


def test_axes_that_still_move_at_the_goal_abort_after_the_goal_time() -> None:
    it = follower(Tolerances.of(2, goal_time=0.1))
    rest, moving = np.zeros(2), np.array([0.0, 0.02])
    goal = it.accept(smooth(1.0, 0, 0), 10.0, AxisStates(rest, rest, rest))
    it.sample(11.2, AxisStates(rest, moving, rest))
    assert goal.result is not None
    assert "still moving 0.1 s after the end" in goal.result.text


def test_a_goal_brings_its_own_tolerances() -> None:
    axes = Axes(follower(Tolerances.of(2, path=0.01)), error=0.05)
    goal = axes.accept(smooth(1.0, 1.0, 0), Tolerances.of(2, path=0.1))
    axes.run(0.5)
    assert goal.status is Status.ACTIVE


def test_the_other_joints_of_a_partial_trajectory_stop_and_hold() -> None:
    axes = Axes(follower(options=FollowerOptions(partial=True)))
    axes.accept(smooth(1.0, 0, 1.0))
    axes.run(0.5)
    axes.accept(trajectory(point(0.5, [0.4], [0]), point(1.0, [0.2], [0]), joints=("a",)))
    axes.run(1.1)
    assert axes.commanded == pytest.approx([0.2, 0.5 + 1.5 * 0.5 / 2])
    assert not axes.velocity.any()


def test_a_time_that_goes_back_repeats_the_last_set_points() -> None:
    axes = Axes(follower())
    axes.accept(smooth(1.0, 1.0, 0))
    axes.run(0.5)
    position, _ = axes.it.sample(axes.now - 0.3, axes.state)
    assert position == pytest.approx(axes.commanded)


def test_after_the_end_the_last_point_is_held_although_the_axes_lag() -> None:
    axes = Axes(follower())
    axes.accept(smooth(1.0, 0.5, -0.5))
    axes.run(1.0)
    behind = AxisStates(axes.commanded, axes.velocity, axes.commanded - 0.01)
    for k in range(1, 4):
        position, _ = axes.it.sample(axes.now + k * STEP, behind)
        assert position == pytest.approx([0.5, -0.5])


def test_abort_forgets_the_motion() -> None:
    axes = Axes(follower())
    goal = axes.accept(smooth(1.0, 1.0, 0))
    axes.run(0.5)
    axes.it.abort("the lease has ended")
    assert goal.result == (Status.ABORTED, Code.INVALID_GOAL, "the lease has ended")
    axes.commanded = np.array([0.3, 0.0])  # moved by another program
    axes.run(STEP)
    assert axes.commanded == pytest.approx([0.3, 0])


def test_unknown_commanded_positions_are_refused() -> None:
    axes = Axes(follower())
    axes.commanded = np.array([math.nan, 0])
    assert "commanded positions" in str(refused(axes, smooth(1.0, 1.0, 0)))


POSITIONS = st.lists(st.floats(-1, 1), min_size=2, max_size=2)
MESSAGES = st.lists(
    st.tuples(st.floats(0.02, 0.5), st.floats(0.1, 2.0), POSITIONS, st.integers(1, 3)),
    min_size=1,
    max_size=6,
)


@settings(max_examples=60, deadline=None)
@given(MESSAGES, st.booleans())
def test_any_sequence_of_trajectories_is_continuous_and_within_the_limits(
    messages: list[tuple[float, float, list[float], int]], cancel: bool
) -> None:
    axes = Axes(follower(acceleration=20.0, deceleration=20.0))
    rest = [0.0] * len(JOINTS)
    for wait, duration, positions, orders in messages:
        fields = [positions, rest, rest][: max(orders, 2)]
        with contextlib.suppress(TrajectoryError):  # beyond a limit
            axes.accept(trajectory(point(duration, *fields)))
        axes.run(wait)
    if cancel:
        axes.it.cancel(axes.now)
    axes.run(2.5)
    rows, speeds = np.array([np.zeros(2), *axes.positions]), np.array(axes.velocities)
    assert abs(rows).max() <= 3.0 + FINE
    assert abs(speeds).max() <= 2.0 * (1 + 1e-6)
    assert abs(np.diff(rows, axis=0)).max() <= 2.0 * STEP * (1 + 1e-6)
    assert abs(np.diff(speeds, axis=0)).max() <= 20.0 * STEP * (1 + 1e-6)
    assert not axes.it.active

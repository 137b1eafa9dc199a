"""The application follows a trajectory in CSP and is late now and then. The core continues the
set-points at their velocity, and returns to them: the velocity never steps by more than a·T.
A step of 3 rad in the set-points is refused, and the arm does not move by it.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.plan.stop_reason import StopReason
from tests.scenario.frames import sent_to_axis
from tests.scenario.vertical import (
    COUNTS,
    GEAR,
    LAG,
    MS,
    RAMP,
    RESOLUTION,
    Sample,
    Trace,
    VerticalCell,
    follow,
    until_taken,
    vertical_cell,
)

ACCELERATION = 10.0  # rad/s²
KEEP = 0.010  # s
SERVO_LAG = 0.010 + LAG  # s: position loop and velocity loop
COUNTS_PER_RAD = COUNTS * GEAR / (2 * np.pi)
LIMITS = {
    "velocity_limit": 4.0,
    "deceleration_limit": ACCELERATION,
    "acceleration_limit": ACCELERATION,
}


def drive_through(
    cell: VerticalCell, loop: cat.Loop, arm: cat.Drives, velocity: float, pause: int
) -> tuple[Trace, float]:
    """Follow a trajectory by its time, with one pause [ms] of the application.

    Returns one sample per millisecond from the pause on, and the angle of the trajectory at the
    first one [rad].
    """
    cycle = follow(cell, arm, loop, 300, velocity)
    start, begin = float(arm.target.position[0]), cycle.time
    samples: list[Sample] = []
    for cycle in loop:
        samples.append(cell.sample())
        if cycle.time > begin + 0.4:
            break
        target = start + velocity * (cycle.time - begin)
        for _ in range(pause if len(samples) == 1 else 0):
            cycle.spend(MS)
            samples.append(cell.sample())
        arm.target.position[:] = target
    return Trace(samples), start + velocity * MS


@pytest.mark.parametrize("pause", [1, 5, 12, 30, 45])
@pytest.mark.parametrize("velocity", [-1.0, 1.0])
def test_the_velocity_has_no_step_and_the_deviation_is_bounded(velocity: float, pause: int) -> None:
    """Bound of the deviation from the trajectory: a·t² for the time t beyond 10 ms, half of it
    while decelerating and half while accelerating again; and the lag of the drive."""
    with vertical_cell() as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm) as loop:
            trace, start = drive_through(cell, loop, arm, velocity, pause)
            assert arm.enabled.all()
    assert np.abs(np.diff(trace.velocity)).max() < 2 * ACCELERATION * MS  # the drive overshoots
    ideal = start + velocity * MS * np.arange(len(trace.joint))
    beyond = max(0.0, pause * MS + 2 * MS - KEEP)
    bound = ACCELERATION * beyond**2 + abs(velocity) * (SERVO_LAG + 2 * MS) + RESOLUTION
    deviation = trace.joint - ideal
    assert abs(deviation).max() < bound
    assert abs(deviation[-1]) < abs(velocity) * (SERVO_LAG + 2 * MS) + RESOLUTION


def commanded(recording: Path, loop_plan: object) -> np.ndarray:
    """Return the commanded positions of all frames [rad]."""
    sent = sent_to_axis(recording, loop_plan)  # type: ignore[arg-type]
    return np.array([each.position for each in sent]) / COUNTS_PER_RAD


@pytest.mark.parametrize("pause", [5, 30])
def test_the_commanded_velocity_changes_by_at_most_a_t(pause: int, tmp_path: Path) -> None:
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(record=recording) as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm) as loop:
            plan = loop.plan.cycle
            drive_through(cell, loop, arm, 1.0, pause)
            last = cell.link.seen(traffic="cyclic")
    path = commanded(recording, plan)[last - 450 : last - 1]
    velocity = np.diff(path) / MS
    rounding = 2 / COUNTS_PER_RAD / MS
    assert np.abs(np.diff(velocity)).max() < ACCELERATION * MS + rounding
    assert velocity[-1] == pytest.approx(1.0, abs=rounding)


@pytest.mark.parametrize("pause", [2, 7])
def test_a_trajectory_that_waits_for_the_application_does_not_jump(
    pause: int, tmp_path: Path
) -> None:
    """The application counts set-points instead of reading the time: after a pause they go on
    where they were. The set-point that is `pause` cycles old lies on the extrapolation, the next
    one is velocity * pause behind it: the command must return to it without a step.
    Bound: acceleration of the fallback, and the set-points' own. (Found by the soak.)"""
    velocity = 0.3
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(record=recording) as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm) as loop:
            plan = loop.plan.cycle
            cycle = follow(cell, arm, loop, 300, velocity)
            target = arm.target.position.copy()
            for k, cycle in enumerate(loop):
                target += velocity * MS
                arm.target.position[:] = target
                if k == 100:
                    cycle.spend(pause * MS)
                if k == 300:
                    break
            last = cell.link.seen(traffic="cyclic")
    path = commanded(recording, plan)[last - 290 : last - 1]
    rounding = 2 / COUNTS_PER_RAD / MS
    assert np.diff(path).min() / MS > -rounding  # never backwards: no set-point is
    assert np.abs(np.diff(np.diff(path) / MS)).max() < velocity + ACCELERATION * MS + rounding


def test_a_step_of_3_rad_is_refused() -> None:
    """Bound: the arm stays; at the late limit it falls until the brake has closed."""
    with vertical_cell() as cell:
        arm = cell.drives(velocity_limit=6.28)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            follow(cell, arm, loop, 100)
            before = cell.joint
            samples = []
            for cycle in loop:
                arm.target.position[:] = 3.0
                samples.append(cell.sample())
                if cycle.number > 300:
                    break
            assert arm.stopped == (StopReason.REFUSED,)
        trace = Trace(samples)
        assert trace.joint.max() - before < RESOLUTION
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION


def test_nothing_is_continued_after_a_stop_request() -> None:
    """Bound: v² / 2a of 0x6085 and the drive's lag; then the fall until the brake has closed."""
    with vertical_cell() as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 300, 1.0)
            arm.quick_stop()
            before, velocity = cell.joint, cell.velocity
            trace = cell.compute(next(loop), 0.3)
        way = velocity**2 / (2 * RAMP) + velocity * (LAG + 2 * MS)
        assert trace.joint.max() - before < way + RESOLUTION
        highest = int(trace.joint.argmax())
        assert trace.joint[highest] - trace.joint[highest:].min() < cell.fall_bound() + RESOLUTION


def test_a_position_limit_is_not_passed() -> None:
    """Bound: the limit. The arm is 20 ms before it when the application is late."""
    with vertical_cell() as cell:
        arm = cell.drives(**LIMITS, position_max=0.3)
        with cat.Loop(arm, stop=cat.StopPolicy(late_limit=0.2)) as loop:
            cycle = follow(cell, arm, loop, 280, 1.0)
            assert 0.25 < cell.joint < 0.28
            trace = cell.compute(cycle, 0.15)
        assert trace.powered.all()
        assert trace.joint.max() < 0.3 + RESOLUTION


@pytest.mark.parametrize("ends_at_rest", [True, False])
def test_a_closed_stream_is_not_continued(ends_at_rest: bool) -> None:
    """Bound: the last row; where it ends at speed, v² / 2a and the drive's lag beyond it."""
    with vertical_cell() as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 50)
            phase = np.linspace(0.0, np.pi if ends_at_rest else np.pi / 2, 300)
            path = arm.target.position + 0.1 * (1 - np.cos(phase))[:, None]
            stream = loop.stream()
            stream.write(path)
            cycle = until_taken(loop, stream, 300)
            stream.close()
            trace = cell.compute(cycle, 1.0)
            assert trace.powered.all()
        last, before = (float(row[0]) for row in (path[-1], path[-2]))
        velocity = (last - before) / MS
        beyond = velocity**2 / (2 * ACCELERATION) + velocity * (SERVO_LAG + MS)
        assert trace.joint.max() < last + beyond + RESOLUTION


def test_alternating_set_points_are_not_continued() -> None:
    """A single step is not a velocity. Bound: the step."""
    with vertical_cell() as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 100)
            before = cell.joint
            arm.target.position[:] += 0.003
            trace = cell.compute(next(loop), 0.03)
        assert trace.joint.max() - before < 0.003 + RESOLUTION
        assert all(a == b for a, b in pairwise(trace.powered))


def test_a_velocity_offset_does_not_push_against_the_held_position() -> None:
    """0x60B1 follows the fallback velocity. Bound: where the command ends, v · 10 ms + v² / 2a."""
    velocity = 0.5
    with vertical_cell() as cell:
        arm = cell.drives(**LIMITS, columns=["velocity_offset"])
        with cat.Loop(arm, stop=cat.StopPolicy(late_limit=1.0)) as loop:
            for cycle in loop:
                arm.target.position[:] += velocity * MS
                arm.target["velocity_offset"][:] = velocity
                if cycle.number == 300:
                    break
            last = float(arm.target.position[0]) - velocity * MS  # the one that is committed
            trace = cell.compute(cycle, 0.8)
            assert trace.powered.all()
        end = last + velocity * KEEP + velocity**2 / (2 * ACCELERATION)
        assert abs(float(trace.joint[-1]) - end) < velocity * 2 * MS + RESOLUTION

"""A drive on a vertical axis loses bit 12 of its statusword: it ignores its targets meanwhile.
For up to three cycles the set-points go on. Longer: CSP commands where the drive stands, and
returns from there. After 10 ms the axis is given up, and the brake closes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary.plan.stop_reason import StopReason
from catenary.virtual import ServoQuirks
from tests.scenario.frames import sent_to_axis
from tests.scenario.vertical import (
    COUNTS,
    GEAR,
    LAG,
    LOAD,
    MS,
    RAMP,
    RESOLUTION,
    Sample,
    Trace,
    VerticalCell,
    follow,
    vertical_cell,
)

VELOCITY = 0.5  # rad/s
ACCELERATION = 10.0  # rad/s²
SERVO_LAG = 0.010 + LAG  # s: position loop and velocity loop
GIVEN_UP = 0.010  # s
COUNTS_PER_RAD = COUNTS * GEAR / (2 * np.pi)
LIMITS = {
    "velocity_limit": 4.0,
    "deceleration_limit": ACCELERATION,
    "acceleration_limit": ACCELERATION,
}


def lose_bit_12(
    cell: VerticalCell, arm: cat.Drives, loop: cat.Loop, seconds: float, velocity: float = VELOCITY
) -> tuple[Trace, float]:
    """Move, hide the bit, and go on writing for 0.4 s.

    Returns the samples since then and the angle of the trajectory at the first one [rad].
    """
    cycle = follow(cell, arm, loop, 300, velocity)
    start, begin = float(arm.target.position[0]), cycle.time
    cell.servo.hide_bit_12(seconds)
    samples: list[Sample] = []
    for cycle in loop:
        arm.target.position[:] = start + velocity * (cycle.time - begin)
        arm.target.velocity[:] = velocity
        arm.target.torque[:] = cell.gravity
        samples.append(cell.sample())
        if cycle.time > begin + 0.4:
            break
    return Trace(samples), start


@pytest.mark.parametrize("velocity", [-VELOCITY, VELOCITY])
def test_three_cycles_without_bit_12_change_nothing(velocity: float, tmp_path: Path) -> None:
    """Bound: the drive stands for 3 ms, and its lag."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(record=recording) as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm) as loop:
            plan = loop.plan.cycle
            trace, start = lose_bit_12(cell, arm, loop, 3 * MS, velocity)
            assert arm.enabled.all()
        ideal = start + velocity * MS * np.arange(len(trace.joint))
        bound = abs(velocity) * (SERVO_LAG + 3 * MS + 2 * MS) + RESOLUTION
        assert abs(trace.joint - ideal).max() < bound
    path = np.array([each.position for each in sent_to_axis(recording, plan)][-450:-50])
    assert np.ptp(np.diff(path)) <= 1  # the command went on as if nothing was


@pytest.mark.parametrize("columns", [[], ["position_demand"]])
@pytest.mark.parametrize("velocity", [-VELOCITY, VELOCITY])
def test_after_three_cycles_the_command_is_the_actual_position(
    velocity: float, columns: list[str], tmp_path: Path
) -> None:
    """Bound: the drive stands for 7 ms, the way back within the acceleration, and its lag."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(record=recording) as cell:
        arm = cell.drives(**LIMITS, columns=columns)
        with cat.Loop(arm) as loop:
            trace, start = lose_bit_12(cell, arm, loop, 7 * MS, velocity)
            assert arm.enabled.all()
        ideal = start + velocity * MS * np.arange(len(trace.joint))
        # it stands, then accelerates from rest to v: v² / 2a behind
        behind = abs(velocity) * 11 * MS + velocity**2 / (2 * ACCELERATION)
        bound = behind + abs(velocity) * SERVO_LAG + RESOLUTION
        assert abs(trace.joint - ideal).max() < bound
        assert abs(trace.joint - ideal)[-1] < abs(velocity) * (SERVO_LAG + 2 * MS) + RESOLUTION


@pytest.mark.parametrize("velocity", [-VELOCITY, 0.0, VELOCITY])
def test_after_10_ms_the_axis_is_stopped(velocity: float) -> None:
    """Bound: v² / 2a of 0x6085 and the lag of the drive, the fall until the brake has closed."""
    with vertical_cell() as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            trace, start = lose_bit_12(cell, arm, loop, float("inf"), velocity)
            assert arm.stopped == (StopReason.NOT_FOLLOWING,)
        assert GIVEN_UP <= trace.powered_ms * MS <= GIVEN_UP + 6 * MS
        way = velocity**2 / (2 * RAMP) + abs(velocity) * SERVO_LAG
        assert trace.fall(start) < way + cell.fall_bound() + RESOLUTION


def test_in_cst_the_torque_stays_until_the_axis_is_stopped() -> None:
    """Bound: the fall until the brake has closed."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            before = cell.joint
            trace, _ = lose_bit_12(cell, arm, loop, float("inf"))
            assert arm.stopped == (StopReason.NOT_FOLLOWING,)
        held = trace.torque[: trace.powered_ms]
        assert held == pytest.approx(LOAD, abs=0.1)
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION


def test_a_drive_that_follows_without_bit_12_keeps_its_position() -> None:
    """A flickering bit: the drive obeys. Bound: it is led from its actual position, and stops."""
    with vertical_cell(quirks=ServoQuirks(follows_without_bit_12=True)) as cell:
        arm = cell.drives(**LIMITS)
        with cat.Loop(arm) as loop:
            trace, start = lose_bit_12(cell, arm, loop, 7 * MS, 0.0)
            assert arm.enabled.all()
        assert abs(trace.joint - start).max() < 2 * RESOLUTION

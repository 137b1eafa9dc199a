"""The drive makes the trajectory of an arm under gravity: profile position and profile velocity.
A late program leaves a PP move to the drive, which ends it and holds. In PV the drive stops quickly
after the late limit. A stop of a move, the end of the loop and a law's end have their own ways.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.plan.stop_reason import StopReason
from tests.scenario.vertical import (
    LAG,
    MS,
    RAMP,
    RESOLUTION,
    VerticalCell,
    until_taken,
    vertical_cell,
)

LATE = 0.050  # s
REACTION = 2 * MS  # the frame of the quick stop, and its effect
DECELERATION = 10.0  # rad/s², 0x6084 of the drive
SPEED = 0.5  # rad/s
POSITION_LAG = 10e-3  # s of the drive's position loop
EVENTS = cat.StopPolicy(on_axis_stopped="event")


def iterate(loop: cat.Loop, cycles: int) -> cat.Cycle:
    return [next(loop) for _ in range(cycles)][-1]


def turning(cell: VerticalCell, arm: cat.Drives, loop: cat.Loop, velocity: float) -> cat.Cycle:
    """Turn in PV until the velocity is reached."""
    for cycle in loop:
        arm.target.velocity[:] = velocity
        if abs(cell.velocity - velocity) < 0.02:
            return cycle
    raise AssertionError("the loop ended")


def test_a_late_program_in_pp_leaves_the_move_to_the_drive() -> None:
    """Bound: the goal; the drive holds there, whatever the program does."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="pp", velocity_limit=2.0)
        with cat.Loop(arm, stop=EVENTS) as loop:
            start = cell.joint
            move = arm.move_to(arm.actual.position + 0.3, velocity=SPEED, acceleration=5.0)
            cycle = iterate(loop, 100)
            trace = cell.compute(cycle, 3.0)
            next(loop)
            assert trace.powered.all()
            assert trace.joint[-1] - start == pytest.approx(0.3, abs=RESOLUTION)
            assert trace.joint.max() - start < 0.3 + RESOLUTION
            assert arm.stopped == (None,)
            loop.wait(move)


def test_a_stop_of_a_move_in_pp_decelerates_and_holds() -> None:
    """Bound: the ramp of 0x6084 as the move wrote it, and the lag of the position loop."""
    acceleration = 5.0
    with vertical_cell() as cell:
        arm = cell.drives(mode="pp", velocity_limit=2.0)
        with cat.Loop(arm) as loop:
            move = arm.move_by(1.0, velocity=SPEED, acceleration=acceleration)
            iterate(loop, 400)
            before = cell.joint
            move.stop()
            loop.wait(move)
            way = cell.joint - before
            assert SPEED**2 / (2 * acceleration) * 0.5 < way
            assert (
                way < SPEED**2 / (2 * acceleration) + SPEED * (3 * MS + POSITION_LAG) + RESOLUTION
            )
            held = cell.joint
            iterate(loop, 500)
            assert cell.joint == pytest.approx(held, abs=RESOLUTION)


@pytest.mark.parametrize("mode", ["pp", "pv"])
def test_leaving_while_the_drive_moves(mode: str) -> None:
    """Bound: quick stop at once; then the fall until the brake has closed."""
    with vertical_cell() as cell:
        arm = cell.drives(mode=mode, velocity_limit=2.0)
        with cat.Loop(arm) as loop:
            if mode == "pp":
                arm.move_by(-1.0, velocity=SPEED)
                iterate(loop, 400)
            else:
                turning(cell, arm, loop, -SPEED)
            before, downwards = cell.joint, -cell.velocity
        ramp = downwards**2 / (2 * RAMP) + downwards * (REACTION + LAG)
        assert cell.fall(before) < ramp + cell.fall_bound() + RESOLUTION


def test_a_late_program_in_pv_is_stopped_after_the_late_limit() -> None:
    """Bound: the velocity for the late limit, the drive's quick stop, the fall to the brake."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="pv", velocity_limit=2.0)
        with cat.Loop(arm, stop=EVENTS) as loop:
            cycle = turning(cell, arm, loop, -SPEED)
            before, downwards = cell.joint, 1.1 * SPEED
            trace = cell.compute(cycle, 1.0)
            next(loop)
            assert arm.stopped == (StopReason.UNDERRUN,)
        assert LATE <= trace.powered_ms * MS <= LATE + 2 * REACTION
        ramp = downwards * (LATE + REACTION + LAG) + downwards**2 / (2 * RAMP)
        assert trace.fall(before) < ramp + cell.fall_bound() + RESOLUTION


def test_a_hand_over_in_pv_stands_still_on_the_drives_ramp() -> None:
    """Bound: the ramp of 0x6084; the drive holds without limit."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="pv", velocity_limit=2.0)
        with cat.Loop(arm) as loop:
            turning(cell, arm, loop, SPEED)
            stream = loop.stream()
            stream.write(velocity=[[SPEED]] * 20)
            cycle = until_taken(loop, stream, 20)
            stream.close()
            before = cell.joint
            trace = cell.compute(cycle, 1.0)
            assert trace.powered.all()
            assert abs(cell.velocity) < 0.01
            allowed = SPEED * (REACTION + LAG) + SPEED**2 / (2 * DECELERATION)
            assert cell.joint - before < allowed + RESOLUTION

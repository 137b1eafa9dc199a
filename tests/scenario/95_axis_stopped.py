"""The core stops an axis that must not stop silently: a program is late on a vertical axis.
There is an event, `arm.stopped` keeps the reason, and the iteration raises for a required axis.
A program that does nothing about it ends with an exit status that is not 0.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import catenary as cat
from catenary import events
from catenary.errors import DriveError
from catenary.plan.cycle import DatagramKind
from catenary.plan.stop_reason import StopReason
from catenary.virtual.faults import garble, lose_frames
from tests.scenario.cell import Cell
from tests.scenario.vertical import MS, RESOLUTION, VerticalCell, follow, vertical_cell

ROOT = Path(__file__).resolve().parents[2]
DATAGRAM_HEADER = 10  # bytes
LATE = {"cst": "10 ms in CST", "csp": "50 ms in CSP", "csv": "50 ms in CSV"}

PROGRAM = """
import catenary as cat
from tests.scenario.vertical import follow, vertical_cell

with vertical_cell() as cell:
    arm = cell.drives(mode="cst", velocity_limit=6.0)
    try:
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 100).spend(1.0)
            follow(cell, arm, loop, 100)
    finally:
        print(cell.fall(0.0), cell.fall_bound(), cell.powered)
"""


def al_status_offset(loop: cat.Loop) -> int:
    """Return the offset in the cyclic frame of the AL status of all devices."""
    [frame] = loop.plan.cycle.frames
    offsets = [d.offset for d in frame.datagrams if d.kind is DatagramKind.AL_STATUS]
    return offsets[0] + DATAGRAM_HEADER


def stopped_events(cell: VerticalCell) -> list[events.AxisStopped]:
    return [event for event in cell.main.events if isinstance(event, events.AxisStopped)]


@pytest.mark.parametrize("mode", ["cst", "csp", "csv"])
def test_the_iteration_raises_and_names_axis_cycle_and_reason(mode: str) -> None:
    """Bound: the fall until the brake has closed."""
    with vertical_cell() as cell:
        arm = cell.drives(mode=mode, velocity_limit=6.0)
        stops = pytest.raises(DriveError, match="lift was stopped in cycle")
        with stops as caught, cat.Loop(arm) as loop:
            cycle = follow(cell, arm, loop, 300)
            before = cell.joint
            cycle.spend(1.0)
            next(loop)
        assert LATE[mode] in caught.value.message
        [event] = stopped_events(cell)
        assert (event.axis, event.reason) == (arm.names[0], StopReason.UNDERRUN)
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION


def test_with_the_event_policy_the_axis_can_be_enabled_again() -> None:
    """Bound: the fall until the brake has closed; enabling moves nothing."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            cycle = follow(cell, arm, loop, 100)
            before = cell.joint
            cycle.spend(1.0)
            follow(cell, arm, loop, 100)
            assert arm.stopped == (StopReason.UNDERRUN,)
            assert len(stopped_events(cell)) == 1
            assert not cell.powered
            assert cell.fall(before) < cell.fall_bound() + RESOLUTION
            fallen = cell.joint
            arm.enable()
            follow(cell, arm, loop, 300)
            assert arm.stopped == (None,)
            assert arm.enabled.all()
            assert abs(cell.fall(fallen)) < RESOLUTION


def test_a_stop_by_the_application_is_not_an_event() -> None:
    with vertical_cell() as cell:
        arm = cell.drives(velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 100)
            arm.disable()
            follow(cell, arm, loop, 200)
            assert arm.stopped == (None,)
        assert stopped_events(cell) == []


def test_a_program_that_is_late_ends_with_an_exit_status() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, cwd=ROOT, timeout=120
    )
    assert done.returncode != 0
    assert "lift was stopped in cycle" in done.stderr
    fall, bound, powered = done.stdout.split()
    assert float(fall) < float(bound) + RESOLUTION
    assert powered == "False"


def test_the_reason_is_kept_until_the_next_request() -> None:
    with vertical_cell() as cell:
        arm = cell.drives(velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            follow(cell, arm, loop, 100).spend(60 * MS)
            follow(cell, arm, loop, 500)
            assert arm.stopped == (StopReason.UNDERRUN,)


def test_a_stop_while_the_states_of_the_devices_are_read_is_announced(cell: Cell) -> None:
    """A reply is garbled: the AL status in it is not OP, and the loop reads the states of all
    devices. Frames are lost meanwhile, so that the core stops all axes. (Found by the soak.)"""
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
        for cycle in loop:
            arm.target.position[:] = arm.actual.position
            if cycle.number == 100:
                now = cell.segment.time
                cell.segment.inject(garble(offset=al_status_offset(loop), n=1, at=now))
                cell.segment.inject(lose_frames(way="back", at=now + 2.5 * MS, for_=4 * MS))
            if cycle.number > 200:
                break
        assert arm.stopped == (StopReason.DEVICE_LOST,) * 2
    stops = [event for event in cell.main.events if isinstance(event, events.AxisStopped)]
    assert [(each.axis, each.reason) for each in stops] == [
        (name, StopReason.DEVICE_LOST) for name in arm.names
    ]

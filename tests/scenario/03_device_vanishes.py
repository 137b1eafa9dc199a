"""The cable after the third device is pulled while all drives move.
The error names the silent devices. The others stop, out of OP.
After the cable is plugged in, a scan finds the same handles, and a new loop runs.
"""

import pytest

import catenary as cat
from catenary.errors import WorkingCounterError
from tests.scenario.cell import OP, Cell


def run_until_it_ends(cell: Cell, arm: cat.Drives) -> WorkingCounterError:
    with pytest.raises(WorkingCounterError) as caught, cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 2.0 * cycle.time
            if cycle.number == 200:
                cell.segment.plug(3)
            assert cycle.number < 220
    return caught.value


def test_the_silent_device_is_named(cell: Cell) -> None:
    error = run_until_it_ends(cell, cell.drives())
    assert f"silent: {cell.subs[3].station}" in str(error)
    assert f"{cell.subs[2].station}" not in error.message
    assert f"between {cell.subs[2].station} port 1 and {cell.subs[3].station} port 0" in error.hint
    assert all(state & 0x0F < OP for state in cell.states[:3])
    assert cell.drive_states[0] != "OPERATION ENABLED"


def test_the_watchdog_stops_an_unreachable_drive(cell: Cell) -> None:
    run_until_it_ends(cell, cell.drives())
    cell.let_pass(0.5)
    cell.assert_safe()


def test_without_any_answer_the_error_suggests_the_cable(cell: Cell) -> None:
    arm = cell.drives()
    with pytest.raises(WorkingCounterError, match="no device answers"), cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 10:
                cell.segment.unplug()
            assert cycle.number < 30
    cell.let_pass(0.5)
    # simple terminals keep their last requested state; their watchdogs cleared the outputs
    assert all(servo.state & 0x0F < OP for servo in cell.servos)
    assert "OPERATION ENABLED" not in cell.drive_states
    cell.segment.plug()


def test_the_same_handles_work_after_the_cable_is_plugged_in(cell: Cell) -> None:
    arm = cell.drives()
    before = list(cell.subs)
    run_until_it_ends(cell, arm)
    cell.let_pass(0.5)
    cell.segment.plug()
    cell.main.scan()
    assert list(cell.subs) == before
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 20:
                break
        assert cell.states == [OP] * 4
    cell.assert_safe()

"""A drive reports a fault while all drives move.
By default, this is a DriveError with the error code of the drive, and all drives stop.
An application may continue. The faulty axis then moves only after a request.
"""

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import DriveError
from catenary.virtual import SercosDrive, Servo
from catenary.wire.cia402 import AxisState
from tests.scenario.cell import KINDS, Cell, cell_with
from tests.scenario.clocked import clocked_cell

OVER_CURRENT = 0x2310
AFTER_RESET = {  # the power section of a SERCOS drive is on while it has mains power
    Servo: AxisState.SWITCH_ON_DISABLED,
    SercosDrive: AxisState.SWITCHED_ON,
}


def code_of(cell: Cell, axis: int) -> str:
    """Return the error code of a faulty drive, as the error shows it."""
    if isinstance(cell.servos[axis], SercosDrive):
        return "0x000F2000 (S-0-0390), 'F2000 error: 2310' (S-0-0095)"
    return "0x2310 (continuous over-current)"


@pytest.fixture(params=KINDS)
def cell(request: pytest.FixtureRequest) -> Iterator[Cell]:
    """Yield a cell with drives of each kind."""
    with cell_with(request.param) as cell:
        yield cell


def test_a_fault_ends_the_loop_with_the_error_code_of_the_drive(cell: Cell) -> None:
    arm = cell.drives()
    with pytest.raises(DriveError) as caught, cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 2.0 * cycle.time
            if cycle.number == 100:
                cell.servos[1].inject_fault(OVER_CURRENT)
            assert cycle.number < 120
    assert arm.names[1] in str(caught.value)
    assert code_of(cell, 1) in str(caught.value)
    assert caught.value.log is not None
    assert len(caught.value.log) > 100  # type: ignore[arg-type]
    cell.assert_safe()


@pytest.mark.parametrize("mode", ["csp", "csv", "cst"])
def test_a_new_loop_resets_the_fault(mode: str) -> None:
    """The reset is as in the hint of the error. In CSV and CST, the first targets follow the reset,
    and a clock event may precede it. (Found by the soak test.)"""
    with clocked_cell(2) as cell:
        arm = cell.drives(mode=mode, dc=True)
        with pytest.raises(DriveError, match="in fault") as caught, cat.Loop(arm) as loop:
            for cycle in loop:
                if cycle.number == 2000:
                    cell.servos[1].inject_fault(OVER_CURRENT)
                assert cycle.number < 3000
        assert "open a new Loop: it resets the fault" in str(caught.value)
        cell.servos[1].inject_fault(0)  # the cause is gone
        with cat.Loop(arm) as loop:
            for _ in zip(loop, range(100), strict=False):
                pass
            assert arm.enabled.all()


def test_an_application_may_continue_after_a_fault(cell: Cell) -> None:
    arm = cell.drives()
    faulty = cell.servos[1]
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            arm.target.position[:] = home + 0.5 * cycle.time
            if cycle.number == 100:
                faulty.inject_fault(OVER_CURRENT)
            if cycle.number == 200:
                assert arm.faults == (1,)
                assert arm.enabled.tolist() == [True, False]
                stopped = faulty.position_rad
                faulty.inject_fault(0)  # the cause is gone
            if cycle.number == 300:
                assert arm.faults == (1,)  # a fault is reset only on request
                arm.reset_faults()
            if cycle.number == 400:
                assert arm.faults == ()
                assert arm.state[0] == AxisState.OPERATION_ENABLED
                assert arm.state[1] == AFTER_RESET[type(faulty)]
                arm.enable(1)
            if cycle.number == (402 if isinstance(faulty, SercosDrive) else 405):
                assert faulty.position_rad == pytest.approx(stopped, abs=1e-3)
            if cycle.number == 500:
                break
        assert arm.enabled.all()
    cell.assert_safe()


def test_reset_alone_moves_nothing(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        for cycle in loop:
            arm.target.position[:] = 1.0
            if cycle.number == 0:
                for servo in cell.servos:
                    servo.inject_fault(OVER_CURRENT)
            if cycle.number == 100:
                for servo in cell.servos:
                    servo.inject_fault(0)
                arm.reset_faults()
                stopped = [servo.position_rad for servo in cell.servos]
            if cycle.number == 300:
                break
        assert arm.state == tuple(AFTER_RESET[type(servo)] for servo in cell.servos)
        assert [servo.position_rad for servo in cell.servos] == pytest.approx(stopped, abs=1e-3)


def test_a_loop_cannot_be_entered_with_a_persistent_fault(cell: Cell) -> None:
    cell.servos[0].inject_fault(OVER_CURRENT)
    arm = cell.drives()
    with pytest.raises(DriveError, match="cannot be enabled") as caught, cat.Loop(arm):
        pytest.fail("entered with a drive in fault")
    assert code_of(cell, 0) in str(caught.value)
    cell.assert_safe()


def test_entering_a_loop_resets_an_old_fault(cell: Cell) -> None:
    cell.servos[0].inject_fault(OVER_CURRENT)
    cell.let_pass(0.1)
    cell.servos[0].inject_fault(0)
    arm = cell.drives()
    with cat.Loop(arm):
        assert set(cell.drive_states) == {"OPERATION ENABLED"}

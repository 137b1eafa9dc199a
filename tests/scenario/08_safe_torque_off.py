"""A guard is opened, and STO removes the torque. Closing the guard must move nothing.
The requested state is then disabled. Only a request of the application enables the axis again.
"""

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import DriveError
from catenary.plan.stop_reason import StopReason
from tests.scenario.cell import KINDS, OP, Cell, cell_with


@pytest.fixture(params=KINDS)
def cell(request: pytest.FixtureRequest) -> Iterator[Cell]:
    """Yield a cell with drives of each kind."""
    with cell_with(request.param) as cell:
        yield cell


def test_nothing_moves_after_sto_until_the_application_requests_it(cell: Cell) -> None:
    arm = cell.drives()
    servo = cell.servos[0]
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            if cycle.number < 100 or cycle.number >= 400:
                arm.target.position[1] = home[1] + 0.5 * cycle.time
            if cycle.number == 100:
                servo.switch_sto(True)
            if cycle.number == 200:
                assert not arm.enabled[0]
                assert arm.faults == ()
                assert arm.stopped == (StopReason.LEFT_OPERATION, None)
                servo.switch_sto(False)
                stopped = servo.position_rad
            if 200 < cycle.number < 400:
                arm.target.position[0] = home[0] + 10.0
                assert cell.drive_states[0] != "OPERATION ENABLED"
                assert servo.position_rad == pytest.approx(stopped, abs=1e-3)
            if cycle.number == 400:
                arm.enable(0)
            if cycle.number == 405:
                assert servo.position_rad == pytest.approx(stopped, abs=1e-3)
            if cycle.number == 450:
                break
        assert arm.enabled.all()
        assert cell.states == [OP] * 4
    cell.assert_safe()


def test_sto_ends_the_loop_unless_the_application_handles_faults(cell: Cell) -> None:
    arm = cell.drives()
    with pytest.raises(DriveError, match="left OPERATION_ENABLED") as caught, cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 100:
                cell.servos[0].switch_sto(True)
            assert cycle.number < 110
    assert arm.names[0] in caught.value.message
    assert arm.names[1] not in caught.value.message
    assert "safe torque off" in caught.value.hint
    cell.assert_safe()


def test_entering_with_active_sto_fails_with_a_hint(cell: Cell) -> None:
    cell.servos[1].switch_sto(True)
    arm = cell.drives()
    with pytest.raises(DriveError, match="SWITCH_ON_DISABLED") as caught, cat.Loop(arm):
        pytest.fail("entered without torque")
    assert "safe torque off" in caught.value.hint
    cell.assert_safe()

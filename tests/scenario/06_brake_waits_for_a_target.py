"""A brake holds a vertical axis in CST. Entering the loop must not open it at 0 N·m.
The drive is enabled with the first torque that the application commits, and applies it at once.
"""

import pytest

import catenary as cat
from tests.scenario.cell import Cell

HOLDING = 0.8  # [N·m]


@pytest.mark.parametrize("mode", ["csv", "cst"])
def test_the_drive_is_not_enabled_before_the_first_target(cell: Cell, mode: str) -> None:
    arm = cell.drives(mode=mode)
    with cat.Loop(arm) as loop:
        assert "OPERATION ENABLED" not in cell.drive_states
        assert "OPERATION ENABLED" not in cell.drive_states
        cycles = iter(loop)
        next(cycles)
        cell.let_pass(0.0)
        assert "OPERATION ENABLED" not in cell.drive_states  # no target has been committed yet
        for cycle in cycles:
            arm.target.torque[:] = HOLDING
            if cycle.number == 50:
                break
        assert set(cell.drive_states) == {"OPERATION ENABLED"}
    cell.assert_safe()


def test_the_first_torque_is_applied_when_the_brake_opens(cell: Cell) -> None:
    arm = cell.drives(mode="cst")
    with cat.Loop(arm) as loop:
        opened: list[float] = []
        for cycle in loop:
            arm.target.torque[:] = HOLDING
            if cell.drive_states[0] == "OPERATION ENABLED":
                opened.append(cell.servos[0].torque_nm)
            if len(opened) == 3:
                break
            assert cycle.number < 100
    assert opened == pytest.approx([HOLDING] * 3, abs=0.01)


def test_without_a_target_the_brake_stays_closed(cell: Cell) -> None:
    arm = cell.drives(mode="cst")
    with cat.Loop(arm, enable=False) as loop:
        for cycle in loop:
            if cycle.number == 100:
                break
        assert "OPERATION ENABLED" not in cell.drive_states

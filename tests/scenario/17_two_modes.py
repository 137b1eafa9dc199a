"""An axis changes from position to torque and back in the loop, while another axis holds.
A mode change alone moves nothing. Set-points take effect when the drive shows the new mode.
"""

import pytest

import catenary as cat
from tests.scenario.cell import Cell


def test_modes_change_without_a_jump(cell: Cell) -> None:
    arm = cell.drives(other_modes=["cst", "csv"])
    servo, neighbour = cell.servos
    with cat.Loop(arm) as loop:
        home = arm.actual.position.copy()
        for cycle in loop:
            if cycle.number == 100:
                arm.switch("cst", axes=0)
            if 100 <= cycle.number < 600:
                arm.target.torque[0] = 0.1 - 0.02 * arm.actual.velocity[0]
            if cycle.number == 599:
                assert arm.actual.mode.tolist() == [10, 8]
                assert servo.velocity_rad_s > 2.0
            if cycle.number == 600:
                arm.switch("csv", axes=0)
            if 600 <= cycle.number < 1000:
                arm.target.velocity[0] = 0.0
            if cycle.number == 999:
                assert servo.velocity_rad_s == pytest.approx(0.0, abs=0.02)
                stood = servo.position_rad
            if cycle.number == 1000:
                arm.switch("csp", axes=0)
            if cycle.number == 1200:
                break
        assert servo.position_rad == pytest.approx(stood, abs=0.01)
        assert neighbour.position_rad == pytest.approx(home[1], abs=1e-3)
        assert arm.enabled.all()
    cell.assert_safe()


def test_a_mode_that_was_not_requested_is_refused(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm), pytest.raises(ValueError, match="other_modes"):
        arm.switch("cst")

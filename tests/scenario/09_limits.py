"""An axis keeps its limits for all targets, and `cycle.limited` reports a clamped target.
For NaN, the axis holds its position, and `cycle.refused` reports it.
"""

import numpy as np
import pytest

import catenary as cat
from catenary.errors import DriveError
from catenary.plan.stop_reason import StopReason
from tests.scenario.cell import Cell

SLACK = 0.03  # [rad] overshoot of the servo when its set-point stops at the limit


def test_position_and_step_are_clamped_in_csp(cell: Cell) -> None:
    arm = cell.drives(position_min=-0.5, position_max=1.0, velocity_limit=2.0, step_limit=1e3)
    fastest = 0.0
    with cat.Loop(arm) as loop:
        for cycle in loop:
            arm.target.position[:] = 50.0 if cycle.time < 1.5 else -50.0
            fastest = max(fastest, *(abs(servo.velocity_rad_s) for servo in cell.servos))
            assert all(-0.5 - SLACK < servo.position_rad < 1.0 + SLACK for servo in cell.servos)
            assert cycle.limited or cycle.number == 0
            if cycle.number == 1400:
                assert cell.servos[0].position_rad == pytest.approx(1.0, abs=SLACK)
                assert arm.limited.all()
            if cycle.time > 3.0:
                break
    assert 1.9 < fastest < 2.5
    cell.assert_safe()


def test_a_step_beyond_the_step_limit_is_refused(cell: Cell) -> None:
    arm = cell.drives(velocity_limit=2.0)
    with (
        pytest.raises(DriveError, match="further than step_limit") as caught,
        cat.Loop(arm) as loop,
    ):
        for cycle in loop:
            arm.target.position[:] = 3.0 if cycle.number > 100 else 0.0
            assert all(abs(servo.position_rad) < 0.01 for servo in cell.servos)
            assert cycle.number < 200
    assert "step_limit" in caught.value.hint
    cell.assert_safe()


def test_a_velocity_stops_at_the_position_limit(cell: Cell) -> None:
    arm = cell.drives(mode="csv", position_max=1.0, velocity_limit=3.0)
    with cat.Loop(arm) as loop:
        for cycle in loop:
            arm.target.velocity[:] = 100.0
            assert all(servo.position_rad < 1.0 + 0.02 for servo in cell.servos)
            assert all(servo.velocity_rad_s < 4.0 for servo in cell.servos)
            if cycle.time > 1.0:
                break
        assert [servo.position_rad for servo in cell.servos] == pytest.approx([1.0, 1.0], abs=0.02)
    cell.assert_safe()


def test_a_torque_is_clamped_and_stops_at_the_position_limit(cell: Cell) -> None:
    arm = cell.drives(mode="cst", position_max=0.5, torque_limit=0.05)
    with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
        for cycle in loop:
            arm.target.torque[:] = 1.9
            assert all(servo.torque_nm < 0.051 for servo in cell.servos if arm.enabled.all())
            if cycle.time > 1.0:
                break
        assert "OPERATION ENABLED" not in cell.drive_states  # only disabling can brake it
        assert arm.stopped == (StopReason.POSITION_LIMIT,) * 2
        assert all(servo.position_rad < 0.6 for servo in cell.servos)
    cell.assert_safe()


@pytest.mark.parametrize("junk", [np.nan, np.inf, -np.inf])
def test_a_target_that_is_not_finite_is_refused_and_the_axis_holds(cell: Cell, junk: float) -> None:
    arm = cell.drives()
    refused = 0
    with cat.Loop(arm) as loop:
        for cycle in loop:
            arm.target.position[:] = junk if 100 <= cycle.number < 120 else 0.1
            refused += cycle.refused
            if cycle.number == 300:
                break
        assert 18 <= refused <= 21
        assert arm.enabled.all()
        assert [servo.position_rad for servo in cell.servos] == pytest.approx([0.1, 0.1], abs=1e-3)
    cell.assert_safe()


def test_targets_within_the_limits_are_not_reported(cell: Cell) -> None:
    arm = cell.drives(position_min=-1.0, position_max=1.0, velocity_limit=5.0, torque_limit=1.0)
    with cat.Loop(arm) as loop:
        for cycle in loop:
            arm.target.position[:] = 0.1 * np.sin(cycle.time)
            assert not cycle.limited
            assert not cycle.refused
            if cycle.number == 500:
                break

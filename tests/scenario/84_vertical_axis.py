"""A vertical axis under gravity: a test of the rig of the following scenarios.
In CSP the drive carries the load. Without torque, the arm falls until its brake has closed.
The fall stays within the stated bound, and the brake then holds.
"""

from __future__ import annotations

import math

import pytest

import catenary as cat
from tests.scenario.vertical import LOAD, VerticalCell, vertical_cell


def hold(cell: VerticalCell, cycles: int = 300) -> float:
    """Hold the arm in CSP, and return its angle [rad] at the moment of a safe torque off."""
    arm = cell.drives()
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
        for cycle in loop:
            if cycle.number == cycles:
                cell.servo.switch_sto(True)
                before = cell.joint
            if cycle.number == cycles + 300:
                return before
    raise AssertionError("the loop ended")


def test_the_load_matches_the_parameters_of_the_rig() -> None:
    with vertical_cell() as cell:
        assert cell.gravity == pytest.approx(LOAD, rel=1e-4)
        assert 15 < cell.g_eff < 18  # 9.81 m/s² / 0.5 m, less the inertia of motor and gear
    with vertical_cell(start=math.pi / 3) as cell:
        assert cell.gravity == pytest.approx(LOAD / 2, rel=1e-4)


def test_the_brake_holds_the_arm_before_a_loop() -> None:
    with vertical_cell(start=0.3) as cell:
        cell.let_pass(2.0)
        assert cell.joint == pytest.approx(0.3, abs=1e-4)
        assert not cell.powered


def test_in_csp_the_drive_carries_the_load() -> None:
    with vertical_cell() as cell:
        arm = cell.drives()
        with cat.Loop(arm) as loop:
            for cycle in loop:
                assert abs(cell.joint) < 1e-3
                if cycle.number == 500:
                    break
            assert cell.powered
            assert cell.torque == pytest.approx(LOAD, rel=0.02)
            assert arm.actual.torque[0] == pytest.approx(LOAD, rel=0.02)


def test_in_cst_the_torque_of_gravity_holds_the_arm() -> None:
    with vertical_cell(start=0.4) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            for cycle in loop:
                arm.target.torque[:] = cell.gravity
                if cycle.number == 300:
                    break
            assert cell.powered
            assert cell.torque == pytest.approx(cell.gravity, abs=0.05)
            assert abs(cell.fall(0.4)) < 0.01


@pytest.mark.parametrize("brake_delay", [0.0, 0.030, 0.100])
def test_without_torque_the_arm_falls_until_the_brake_has_closed(brake_delay: float) -> None:
    with vertical_cell(brake_delay=brake_delay) as cell:
        before = hold(cell)
        fallen, bound = cell.fall(before), cell.fall_bound(reaction=0.0)
        assert fallen < bound
        assert fallen > 0.8 * bound or brake_delay == 0.0
        cell.let_pass(1.0)
        assert abs(cell.fall(before) - fallen) < 1e-4


def test_a_fall_from_above_the_horizon_is_shorter() -> None:
    with vertical_cell(start=1.2) as high, vertical_cell() as level:
        assert high.fall(hold(high)) < 0.5 * level.fall(hold(level))

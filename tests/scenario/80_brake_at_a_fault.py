"""A drive reports a fault while the whole arm moves.
By default, all drives stop, and the brakes of all axes close: nothing falls.
After safe torque off, the brake alone stops the joint, within its torque.
"""

from __future__ import annotations

import numpy as np
import pytest

import catenary as cat
from catenary.errors import DriveError
from tests.scenario.arm import arm_cell

START = [0.0, 0.9, 0.6, 0.0, 0.5, 0.0]
SHOULDER = 1
OVER_CURRENT = 0x2310


def test_a_fault_during_a_motion_closes_all_brakes() -> None:
    with arm_cell(start=START) as cell:
        arm = cell.drives()
        with pytest.raises(DriveError, match="shoulder"), cat.Loop(arm) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + 0.5 * cycle.time
                if cycle.number == 400:
                    assert (cell.plant.data.qvel > 0.4).all()
                    cell.servos[SHOULDER].inject_fault(OVER_CURRENT)
                    faulted = cell.joints
                assert cycle.number < 500
        stopped = cell.joints
        assert np.abs(stopped - faulted).max() < 0.05
        assert all(servo.drive_state() != "OPERATION ENABLED" for servo in cell.servos)
        assert cell.servos[SHOULDER].drive_state() == "FAULT"
        cell.let_pass(2.0)
        assert np.abs(cell.joints - stopped).max() < 1e-4


def sto_in_motion(**joint: object) -> float:
    """Return the distance of the shoulder after safe torque off at about 1 rad/s [rad]."""
    with arm_cell(start=START, **joint) as cell:
        arm = cell.drives()
        with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False)) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[SHOULDER] = home[SHOULDER] + 1.0 * min(cycle.time, 0.4)
                if cycle.number == 300:
                    for servo in cell.servos:
                        servo.switch_sto(True)
                    before = cell.joints[SHOULDER]
                if cycle.number == 600:
                    assert np.abs(cell.plant.data.qvel).max() < 1e-3
                    break
        return float(cell.joints[SHOULDER] - before)


def test_a_brake_alone_stops_a_joint_within_its_torque() -> None:
    """The stopping distance is v² J / 2 (brake - gravity), J about 6 kg·m² at the shoulder."""
    strong, weak = sto_in_motion(brake=300.0), sto_in_motion(brake=150.0)
    assert 0.005 < strong < 0.02
    assert 1.5 * strong < weak < 0.1


def test_until_a_brake_has_closed_the_arm_falls() -> None:
    assert sto_in_motion(brake=300.0, brake_delay=0.05) > sto_in_motion(brake=300.0) + 0.04

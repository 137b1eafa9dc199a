"""An arm is released: in CST at zero torque, the brakes open, and it sinks under its weight.
The application catches it with position control. It stops and stays there.
The drives then hold it with the torque of gravity, as computed by MuJoCo's inverse dynamics.
"""

from __future__ import annotations

import mujoco
import numpy as np

import catenary as cat
from tests.scenario.arm import arm_cell

START = [0.0, 0.9, 0.6, 0.0, 0.5, 0.0]


def test_an_arm_without_torque_sags_and_is_caught() -> None:
    with arm_cell(start=START) as cell:
        arm = cell.drives(mode="csp", other_modes=["cst"])
        with cat.Loop(arm) as loop:
            for cycle in loop:
                if cycle.number == 0:
                    arm.switch("cst")
                if cycle.number < 200:
                    arm.target.torque[:] = 0.0
                if cycle.number == 200:
                    sagged = cell.joints
                    assert sagged[1] > START[1] + 0.05  # the shoulder sinks
                    arm.switch("csp")
                if cycle.number == 600:
                    caught = cell.joints
                    assert np.abs(caught - sagged).max() < 0.2
                if cycle.number == 900:
                    break
            assert np.abs(cell.joints - caught).max() < 1e-4
            assert np.abs(cell.plant.data.qvel).max() < 1e-3


def gravity(plant_model: mujoco.MjModel, joints: np.ndarray) -> np.ndarray:
    """Return the torques that hold the arm at rest [N·m], by MuJoCo's inverse dynamics."""
    data = mujoco.MjData(plant_model)
    data.qpos[:] = joints
    mujoco.mj_inverse(plant_model, data)
    return data.qfrc_inverse.copy()


def test_at_rest_the_drives_apply_the_torque_of_gravity() -> None:
    """Dry friction may carry a part of it, up to the friction torque."""
    with arm_cell(start=START) as cell:
        arm = cell.drives()
        with cat.Loop(arm) as loop:
            for cycle in loop:
                if cycle.number == 1000:
                    break
            asked = arm.actual.torque.copy()
        expected = gravity(cell.plant.model, cell.joints)
        dry = [
            s.coulomb_friction * j.gear for s, j in zip(cell.servos, cell.plant.joints, strict=True)
        ]
        assert expected[1] < -40  # [N·m] a considerable load
        assert (np.abs(asked - expected) <= np.array(dry) + 0.1).all()

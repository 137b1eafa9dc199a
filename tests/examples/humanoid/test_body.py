"""The model of the humanoid and the table of its joints agree, and its drives are plausible."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import body
import numpy as np
import pytest

mujoco = pytest.importorskip(
    "mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'"
)

LEG = ("hip_yaw", "hip_roll", "hip_pitch", "knee", "ankle_pitch", "ankle_roll")


@pytest.fixture
def model() -> Any:
    return body.load_model()


@pytest.fixture
def data(model: Any) -> Any:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
    mujoco.mj_forward(model, data)
    return data


def test_the_networks_have_18_and_15_joints_in_the_agreed_order() -> None:
    assert len(body.UPPER) == 18
    assert len(body.LOWER) == 15
    assert body.NAMES[:2] == ("left_clavicle", "left_shoulder_pitch")
    assert body.NAMES[15:18] == ("right_wrist_roll", "neck_yaw", "neck_pitch")
    assert body.NAMES[18:21] == ("waist_yaw", "waist_pitch", "waist_roll")
    assert body.NAMES[21:] == tuple(f"{s}_{name}" for s in ("left", "right") for name in LEG)
    assert all(joint.network == "upper" for joint in body.UPPER)
    assert all(joint.network == "lower" for joint in body.LOWER)


def test_the_model_has_the_joints_and_a_free_base(model: Any) -> None:
    assert model.njnt == 34
    assert model.joint("base").type == mujoco.mjtJoint.mjJNT_FREE
    hinges = [model.joint(name).type for name in body.NAMES]
    assert hinges == [mujoco.mjtJoint.mjJNT_HINGE] * 33


def test_the_mass_is_that_of_a_grown_robot(model: Any) -> None:
    assert 95 <= model.body_mass.sum() <= 105


def test_the_model_has_the_sensors(model: Any) -> None:
    assert {name: int(model.sensor(name).dim[0]) for name in body.SENSORS} == body.SENSORS


def test_limits_and_standing_pose_are_those_of_the_model(model: Any) -> None:
    ranges = np.array([model.joint(name).range for name in body.NAMES])
    np.testing.assert_allclose(ranges, np.stack([body.LOW, body.HIGH], axis=1), atol=1e-9)
    np.testing.assert_allclose(model.qpos0[body.position_indices(model)], body.STAND, atol=1e-9)
    np.testing.assert_allclose(model.key("stand").qpos, model.qpos0, atol=1e-6)


def test_nothing_overlaps_at_the_start(model: Any, data: Any) -> None:
    assert all(contact.dist > -1e-3 for contact in data.contact)


def test_it_stands_on_both_soles(model: Any, data: Any) -> None:
    for side in body.SIDES:
        assert abs(data.site(f"{side}_sole").xpos[2]) < 1e-3
        np.testing.assert_allclose(
            data.site(f"{side}_sole").xmat.reshape(3, 3), np.eye(3), atol=1e-6
        )


def test_the_standing_pose_is_close_to_an_equilibrium(model: Any, data: Any) -> None:
    """Its centre of mass is above the soles, and holding it takes a part of the rated torques."""
    centre = data.subtree_com[0]
    middle = data.geom("left_sole").xpos[0]
    assert abs(centre[0] - middle) < 0.02
    assert abs(centre[1]) < 1e-6
    mujoco.mj_inverse(model, data)
    upper = [body.INDEX[joint.name] for joint in body.UPPER]
    torque = data.qfrc_inverse[body.velocity_indices(model)][upper]
    assert (abs(torque) < body.TORQUE[upper] / body.PEAK_RATIO).all()


def test_both_feet_carry_the_weight(model: Any) -> None:
    """The sensors report the force of the body on the foot; a foot on the floor has z < 0."""
    data = mujoco.MjData(model)
    places, dofs = body.position_indices(model), body.velocity_indices(model)
    for _ in range(400):
        error = body.STAND - data.qpos[places]
        data.qfrc_applied[dofs] = 4 * body.STIFFNESS * error - body.DAMPING * data.qvel[dofs]
        mujoco.mj_step(model, data)
    carried = [-data.sensor(f"{side}_foot_force").data[2] for side in body.SIDES]
    assert sum(carried) == pytest.approx(model.body_mass.sum() * 9.81, rel=0.05)
    assert carried[0] == pytest.approx(carried[1], rel=0.01)


def test_the_drives_are_plausible_for_100_kg() -> None:
    peak = dict(zip(body.NAMES, body.TORQUE, strict=True))
    for side in body.SIDES:
        assert all(peak[f"{side}_{name}"] >= 300 for name in ("hip_roll", "hip_pitch", "knee"))
        assert peak[f"{side}_ankle_pitch"] >= 150
        assert 50 <= peak[f"{side}_elbow"] <= 120
    assert all(50 <= joint.motor.gear <= 160 for joint in body.JOINTS)
    speed = [joint.motor.max_velocity / joint.motor.gear for joint in body.JOINTS]
    assert 4 <= min(speed) <= max(speed) <= 12
    assert (body.COULOMB < 0.05 * body.TORQUE).all()


def test_the_motors_are_part_of_the_loaded_model(model: Any) -> None:
    dofs = body.velocity_indices(model)
    np.testing.assert_allclose(model.dof_armature[dofs], body.ARMATURE)
    np.testing.assert_allclose(model.dof_damping[dofs], body.VISCOUS)
    np.testing.assert_allclose(model.dof_frictionloss[dofs], body.COULOMB)
    assert 0.02 < model.dof_armature[model.joint("left_wrist_roll").dofadr[0]] < 0.2


def test_another_model_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.xml"
    other.write_text(body.MODEL.read_text().replace('joint name="neck_yaw"', 'joint name="nek"'))
    with pytest.raises(
        ValueError, match=r"missing joints \['neck_yaw'\], unknown joints \['nek'\]"
    ):
        body.load_model(other)


def test_a_model_without_a_sensor_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.xml"
    text = body.MODEL.read_text()
    other.write_text(text.replace('<gyro name="imu_gyro" site="imu"/>', ""))
    with pytest.raises(ValueError, match=r"no sensors \['imu_gyro'\]"):
        body.load_model(other)

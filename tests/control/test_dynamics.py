"""Gravity and inverse dynamics, compared with a pendulum formula and MuJoCo's Python functions."""

import math
import pickle
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from catenary import control
from catenary.errors import ConfigurationError
from tests.control.arm import PENDULUM, THREE, URDF

JOINTS = ["turn", "shoulder", "elbow"]


@pytest.fixture
def three(tmp_path: Path) -> Path:
    path = tmp_path / "three.xml"
    path.write_text(THREE)
    return path


@pytest.fixture
def pendulum(tmp_path: Path) -> control.Dynamics:
    path = tmp_path / "pendulum.xml"
    path.write_text(PENDULUM)
    return control.Dynamics(path)


def test_a_pendulums_gravity_is_m_g_l_sin(pendulum: control.Dynamics) -> None:
    for angle in np.linspace(-4, 4, 17):
        assert pendulum.gravity([angle])[0] == pytest.approx(2 * 9.81 * 0.5 * math.sin(angle))


def test_a_pendulums_inverse_dynamics(pendulum: control.Dynamics) -> None:
    """(m l² + I + armature) q̈ + b q̇ + m g l sin q"""
    q, v, a = 0.7, -1.3, 4.0
    expected = (2 * 0.25 + 0.01 + 0.05) * a + 0.3 * v + 2 * 9.81 * 0.5 * math.sin(q)
    assert pendulum.inverse([q], [v], [a])[0] == pytest.approx(expected)


def oracle(path: Path, order: list[str], q, v, a) -> np.ndarray:
    """Compute M q̈ + bias with MuJoCo functions that catenary does not use."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    degrees = [model.joint(name).dofadr[0] for name in order]
    data.qpos[[model.joint(name).qposadr[0] for name in order]] = q
    data.qvel[degrees] = v
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    for k in range(model.nv):
        column, unit = np.zeros(model.nv), np.eye(model.nv)[k]
        mujoco.mj_mulM(model, data, column, unit)
        mass[:, k] = column
    acceleration = np.zeros(model.nv)
    acceleration[degrees] = a
    return (mass @ acceleration + data.qfrc_bias)[degrees]


@pytest.mark.parametrize("order", [JOINTS, JOINTS[::-1], ["elbow", "turn", "shoulder"]])
def test_joints_in_the_axes_order(three: Path, order: list[str]) -> None:
    dynamics = control.Dynamics(three, joints=order, axes=3)
    assert dynamics.joints == tuple(order)
    rng = np.random.default_rng(1)
    for _ in range(20):
        q, v, a = rng.uniform(-3, 3, (3, 3))  # also beyond the range of the shoulder
        expected = oracle(three, order, q, v, a)
        assert dynamics.inverse(q, v, a) == pytest.approx(expected, abs=1e-9)
        still = np.zeros(3)
        assert dynamics.gravity(q) == pytest.approx(oracle(three, order, q, still, still))


def test_gravity_does_not_depend_on_an_earlier_call(three: Path) -> None:
    dynamics = control.Dynamics(three, joints=JOINTS)
    q = [0.1, 0.2, 0.3]
    before = dynamics.gravity(q)
    dynamics.inverse([1, 1, 1], [5, 5, 5], [9, 9, 9])
    assert dynamics.gravity(q).tolist() == before.tolist()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"joints": ["turn", "wrist"]},
            r"no joint 'wrist'\n.*the joints turn, shoulder, elbow, ball",
        ),
        ({"joints": ["turn", "turn"]}, "joint 'turn' is given twice"),
        ({}, "joint 'ball' is neither hinge nor slide"),
        ({"joints": JOINTS, "axes": 6}, r"3 joints \(turn, shoulder, elbow\) for 6 axes"),
        ({"joints": []}, "no joints"),
    ],
)
def test_joints_that_do_not_match_are_named(three: Path, options: dict, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        control.Dynamics(three, **options)


def test_motor_inertia_through_the_gear_is_added(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.xml"
    path.write_text(PENDULUM)
    with_motor = control.Dynamics(path, armature=1.5)
    assert with_motor.inverse([0], [0], [2.0])[0] == pytest.approx((2 * 0.25 + 0.06 + 1.5) * 2)
    with pytest.raises(ValueError, match=r"armature has shape \(2,\); give one value, or one for"):
        control.Dynamics(path, armature=[1.0, 2.0])


def test_a_urdf_without_its_meshes(tmp_path: Path) -> None:
    """Two hanging links: the shoulder carries both, the elbow carries the lower one."""
    path = tmp_path / "two.urdf"
    path.write_text(URDF)
    dynamics = control.Dynamics(path, joints=["elbow", "shoulder"], axes=2)
    elbow, shoulder = 0.4, -0.9
    lower = 1.0 * 9.81 * 0.2 * math.sin(shoulder + elbow)
    upper = 9.81 * (3.0 * 0.3 + 1.0 * 0.6) * math.sin(shoulder)
    assert dynamics.gravity([elbow, shoulder]) == pytest.approx([lower, upper + lower])


@pytest.mark.shared_data
def test_indy7_by_its_path(shared_data: Path) -> None:
    """The shoulder carries the masses of the file when the arm is horizontal."""
    path = shared_data / "robots/indy7/derived_indy7_flat.urdf"
    dynamics = control.Dynamics(path, axes=6)
    assert len(dynamics.joints) == 6
    assert dynamics.gravity(np.zeros(6)) == pytest.approx(np.zeros(6), abs=8.0)  # upright
    level = dynamics.gravity([0, np.pi / 2, 0, 0, 0, 0])
    assert 50.0 < abs(level[1]) < 431.97  # [N·m], the largest torque of the joint


def test_a_missing_or_invalid_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"nowhere\.xml"):
        control.Dynamics(tmp_path / "nowhere.xml")
    for text in ("<html/>", "<robot", "<mujoco><worldbody><body/></mujoco>"):
        (tmp_path / "page.xml").write_text(text)
        with pytest.raises(ConfigurationError, match=r"page\.xml"):
            control.Dynamics(tmp_path / "page.xml")


def test_without_mujoco_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, three: Path) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ConfigurationError, match=r"pip install 'catenary\[sim\]'"):
        control.Dynamics(three)


def test_vectors_of_wrong_length_and_the_wrong_memory(three: Path) -> None:
    dynamics = control.Dynamics(three, joints=JOINTS)
    with pytest.raises(
        ValueError, match=r"position has shape .* 3 joints \(turn, shoulder, elbow\)"
    ):
        dynamics.gravity([0.0, 0.0])
    with pytest.raises(ValueError, match="the number of joints of the model differs"):
        control.gravity(dynamics.memory, np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match="not the memory of a Dynamics"):
        control.gravity(np.zeros(40), np.zeros(3), np.zeros(3))


def test_each_law_has_a_workspace_of_its_own(three: Path) -> None:
    dynamics = control.Dynamics(three, joints=JOINTS)
    first, second = dynamics.memory, dynamics.memory
    assert first[3] != second[3]  # address of the mjData
    q, torque = np.array([0.1, 0.2, 0.3]), np.empty(3)
    del dynamics
    control.gravity(first, q, torque)  # the memory outlives the object
    assert torque == pytest.approx(oracle(three, JOINTS, q, np.zeros(3), np.zeros(3)))


def test_another_process_gets_the_same_model(three: Path) -> None:
    model = control.Dynamics(three, joints=JOINTS, armature=0.5)
    copy = pickle.loads(pickle.dumps(model))
    motion = np.full(3, 0.3), np.full(3, 0.2), np.full(3, 0.1)
    assert np.array_equal(copy.inverse(*motion), model.inverse(*motion))

"""Energy residual: comparison with the published formula, and its blind spots."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from catenary import control
from tests.control.arm import THREE

DT = 1e-3
GAIN = 60.0
JOINTS = ["turn", "shoulder", "elbow"]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "three.xml"
    path.write_text(THREE.replace('armature="0.1"', 'armature="0.1" damping="0.4"'))
    return path


class Plant:
    """The arm in MuJoCo, with the energy that MuJoCo computes."""

    def __init__(self, path: Path) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.timestep = DT
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
        self.data = mujoco.MjData(self.model)

    @property
    def energy(self) -> float:
        """Kinetic and potential energy of the three joints, without the free ball [J]."""
        model, judge = self.model, mujoco.MjData(self.model)
        judge.qpos[:3], judge.qvel[:3] = self.data.qpos[:3], self.data.qvel[:3]
        mujoco.mj_fwdPosition(model, judge)
        mujoco.mj_energyPos(model, judge)
        mujoco.mj_fwdVelocity(model, judge)
        mujoco.mj_energyVel(model, judge)
        return float(judge.energy.sum())

    @property
    def state(self) -> tuple[np.ndarray, np.ndarray]:
        return self.data.qpos[:3].copy(), self.data.qvel[:3].copy()

    def step(self, torque: np.ndarray) -> None:
        self.data.qfrc_applied[:3] = torque
        mujoco.mj_step(self.model, self.data)


def run(path: Path, pushed: np.ndarray, steps: int = 600) -> tuple[np.ndarray, ...]:
    """Move the arm; from half of the steps on, an external torque acts.

    Return our estimate, the published formula, and the external power, each (steps,).
    """
    plant, dynamics = Plant(path), control.Dynamics(path, joints=JOINTS)
    block, model = control.EnergyResidual(3, GAIN), dynamics.memory
    kept, torque, before = block.memory, np.zeros(3), np.zeros(3)
    damping = np.array([0.0, 0.0, 0.4])
    first, total, published = plant.energy, 0.0, 0.0
    rows = []
    for k in range(steps):
        q, v = plant.state
        ours = control.energy_residual(kept, block.parameters, model, torque, q, v, DT)
        mean = 0.5 * (v + before)
        total += mean @ (torque - damping * mean) * DT
        published = GAIN * (plant.energy - total - first) / (1.0 + GAIN * DT)
        total += published * DT  # r is taken at the end of the step, as in our block
        external = pushed if k > steps // 2 else np.zeros(3)
        rows.append((ours, published, external @ mean))
        torque = dynamics.gravity(q) + np.array([0.5, -1.0, 0.2])
        plant.step(torque + (pushed if k >= steps // 2 else np.zeros(3)))
        before = v
    return tuple(np.array(rows).T)


def test_the_residual_equals_the_published_formula(path: Path) -> None:
    ours, published, power = run(path, np.array([0.0, 0.0, 3.0]))
    assert power[-1] > 2.0
    assert ours == pytest.approx(published, abs=0.03)
    assert abs(ours[:300]).max() < 0.02


def test_the_residual_is_the_low_pass_of_the_external_power(path: Path) -> None:
    ours, _, power = run(path, np.array([2.0, 0.0, 0.0]))
    expected, state = [], 0.0
    for value in power:
        state = (state + GAIN * value * DT) / (1.0 + GAIN * DT)
        expected.append(state)
    assert ours == pytest.approx(expected, abs=0.03)
    assert ours[-1] > 0.5


def test_at_standstill_the_residual_does_not_show_a_push(path: Path) -> None:
    dynamics, block = control.Dynamics(path, joints=JOINTS), control.EnergyResidual(3, GAIN)
    q, still, model, memory = np.array([0.1, 0.5, -0.3]), np.zeros(3), dynamics.memory, block.memory
    held = dynamics.gravity(q) - np.array([0.0, 8.0, 0.0])  # the motors hold against a push
    for _ in range(200):
        assert control.energy_residual(memory, block.parameters, model, held, q, still, DT) == 0.0


def test_wrong_parameters_and_axes(path: Path) -> None:
    model = control.Dynamics(path, joints=JOINTS).memory
    block, row, two = control.EnergyResidual(3, GAIN), np.zeros(3), np.zeros(2)
    other = control.Residual(3, 1.0).parameters
    with pytest.raises(ValueError, match="not the parameters of an EnergyResidual"):
        control.energy_residual(block.memory, other, model, row, row, row, DT)
    with pytest.raises(ValueError, match="another number of axes"):
        control.energy_residual(block.memory, block.parameters, model, two, two, two, DT)
    with pytest.raises(ValueError, match="gain of axis 0 is 0"):
        control.EnergyResidual(3, 0.0)

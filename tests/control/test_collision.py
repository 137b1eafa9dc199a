"""Residuals: comparison with the published momentum observer, and accuracy."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from catenary import control
from tests.control.arm import THREE

DT = 1e-3
JOINTS = ["turn", "shoulder", "elbow"]


def test_the_residual_follows_the_external_torque_at_first_order() -> None:
    block = control.Residual(1, 50.0, 0.02)
    memory, v, seen = block.memory, 0.0, []
    for k in range(400):
        external = 0.7 if k >= 100 else 0.0
        seen.append(control.residual(memory, block.parameters, 0, 0.3, v, DT))
        v += (0.3 + external) / 0.02 * DT
    after = DT * np.arange(300)
    assert seen[:100] == pytest.approx([0.0] * 100, abs=1e-9)
    assert seen[100:] == pytest.approx(0.7 * (1 - np.exp(-50 * after)), abs=0.02)


def test_a_threshold_needs_its_time_and_ignores_the_sign() -> None:
    block = control.Threshold(2, 1.0, [0.0, 0.003])
    memory = block.memory
    assert not control.threshold(memory, block.parameters, 0, 1.0, DT)
    assert control.threshold(memory, block.parameters, 0, -1.1, DT)
    exceeded = [control.threshold(memory, block.parameters, 1, 2.0, DT) for _ in range(5)]
    assert exceeded == [False, False, False, True, True]
    assert not control.threshold(memory, block.parameters, 1, 0.5, DT)
    assert not control.threshold(memory, block.parameters, 1, 2.0, DT)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "three.xml"
    path.write_text(THREE)
    return path


def published(model, data, states, torques, gain: float) -> np.ndarray:
    """Evaluate r = K (p - ∫ (τ + Cᵀ q̇ - g + r) dt) with Cᵀ q̇ - g = Ṁ q̇ - bias, as published."""
    n, sums, r, rows, before = 3, np.zeros(3), np.zeros(3), [], None
    for (q, v), torque in zip(states, torques, strict=True):
        data.qpos[:n], data.qvel[:n] = q, v
        mujoco.mj_forward(model, data)
        mass = np.zeros((n, n))
        for k in range(n):
            column = np.zeros(model.nv)
            mujoco.mj_mulM(model, data, column, np.eye(model.nv)[k])
            mass[:, k] = column[:n]
        momentum = mass @ v
        if before is None:
            sums = momentum.copy()
        else:
            turned = (mass - before[0]) @ before[1]
            sums += turned + (torque - data.qfrc_bias[:n] + r) * DT
        r = gain * (momentum - sums)
        before = mass, v
        rows.append(r)
    return np.array(rows)


def test_the_residual_with_a_model_equals_the_published_observer(path: Path) -> None:
    """MuJoCo simulates a falling arm; from 0.3 s on, a torque acts on the elbow."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = DT
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    data = mujoco.MjData(model)
    dynamics = control.Dynamics(path, joints=JOINTS)
    block, memory, torque = control.Residual(3, 80.0), dynamics.memory, np.zeros(3)
    kept, states, torques, ours = block.memory, [], [], []
    for k in range(600):
        q, v = data.qpos[:3].copy(), data.qvel[:3].copy()
        external = np.empty(3)
        control.model_residual(kept, block.parameters, memory, torque, q, v, DT, external)
        states.append((q, v))
        torques.append(torque.copy())
        ours.append(external)
        torque = dynamics.gravity(q) + np.array([0.5, -1.0, 0.2])
        pushed = [0.0, 0.0, 3.0] if k >= 300 else [0.0, 0.0, 0.0]
        data.qfrc_applied[:3] = torque + pushed
        mujoco.mj_step(model, data)
    expected = published(model, mujoco.MjData(model), states, torques, gain=80.0)
    assert np.array(ours) == pytest.approx(expected, abs=0.25)
    assert abs(np.array(ours)[:300]).max() < 0.2
    assert ours[-1] == pytest.approx([0.0, 0.0, 3.0], abs=0.2)
    assert abs(expected[-1] - [0, 0, 3.0]).max() < 0.3

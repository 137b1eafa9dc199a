"""The LQR and the policy made from it balance the humanoid, and the policy is an ONNX model."""

from __future__ import annotations

from pathlib import Path

import body
import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")

import policy
from estimate import Estimator, Measurement
from lqr import LinearModel, Lqr, riccati
from simulation import Push, Simulation
from study import policy_balance


@pytest.fixture(scope="module")
def model() -> LinearModel:
    return LinearModel()


def test_the_standing_pose_is_the_origin_of_the_state(model: LinearModel) -> None:
    np.testing.assert_allclose(model.state(Estimator().standing), 0.0, atol=1e-9)


def test_the_state_has_the_order_of_the_model(model: LinearModel) -> None:
    """Pelvis, joints in the order of the model, and then their velocities."""
    measured = Measurement(
        body.STAND.copy(), np.zeros(33), np.array([1.0, 0, 0, 0]), np.array([0.0, 0.3, 0.0])
    )
    measured.position[body.INDEX["neck_yaw"]] += 0.1
    measured.velocity[body.INDEX["neck_yaw"]] = 0.2
    x = model.state(Estimator().step(measured, 1e-3))
    place = body.load_model().joint("neck_yaw").dofadr[0]
    assert x[place] == pytest.approx(0.1)
    assert x[39 + place] == pytest.approx(0.2)
    assert x[39 + 4] == pytest.approx(0.3)


def test_only_feedback_makes_the_linear_model_stable(model: LinearModel) -> None:
    feedback = riccati(model.transition, model.effect, *model.cost())
    closed = model.transition - model.effect @ feedback
    assert np.abs(np.linalg.eigvals(closed)).max() < 1.0
    assert np.abs(np.linalg.eigvals(model.transition)).max() >= 1.0


def test_the_riccati_feedback_of_a_double_integrator() -> None:
    """The solution satisfies the Riccati equation."""
    a, b = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[0.005], [0.1]])
    q, r = np.diag([2.0, 0.5]), np.array([[0.3]])
    k = riccati(a, b, q, r)
    p = q.copy()
    for _ in range(3000):
        p = q + a.T @ p @ a - a.T @ p @ b @ np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
    expected = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
    np.testing.assert_allclose(k, expected, rtol=1e-8)


def test_a_model_that_inputs_cannot_stabilise_is_refused() -> None:
    a, b = np.diag([1.5, 0.5]), np.array([[0.0], [1.0]])
    with pytest.raises(ValueError, match="cannot stabilise"):
        riccati(a, b, np.eye(2), np.eye(1))


def test_the_lqr_stands_under_a_push_of_60_n() -> None:
    assert not Simulation().run(Lqr(), 2.5, (Push((-60.0, 0.0), 0.2),)).fall


def test_the_policy_stands_under_a_push_of_60_n_at_100_hz() -> None:
    calls: list[float] = []
    balance = policy_balance()
    inner = balance._policy

    def counted(observation: np.ndarray, now: float) -> np.ndarray:
        calls.append(now)
        return inner(observation, now)

    balance._policy = counted
    assert not Simulation().run(balance, 2.5, (Push((-60.0, 0.0), 0.2),)).fall
    assert len(calls) == pytest.approx(250, abs=2)


def test_the_policy_is_an_onnx_model(tmp_path: Path) -> None:
    pytest.importorskip("onnx", reason="writes the model: pip install onnx")
    runtime = pytest.importorskip("onnxruntime", reason="runs it: pip install onnxruntime")
    file = policy.write(tmp_path / "folder" / "balance.onnx")
    session = runtime.InferenceSession(file)
    observation = np.random.default_rng(1).normal(0, 0.02, (1, 78)).astype(np.float32)
    [action] = session.run(None, {"observation": observation})
    expected = np.clip(policy.weights() @ observation[0], -policy.LIMIT, policy.LIMIT)
    assert action.shape == (1, policy.ACTION)
    assert action.dtype == np.float32
    np.testing.assert_allclose(action[0], expected, atol=1e-6)
    [limited] = session.run(None, {"observation": 1000 * observation})
    assert np.abs(limited).max() == pytest.approx(policy.LIMIT)


def test_the_slot_of_catenary_runs_the_policy(tmp_path: Path) -> None:
    """A NaN does not reach the goals."""
    control = pytest.importorskip("catenary.control")
    pytest.importorskip("onnx", reason="writes the model: pip install onnx")
    pytest.importorskip("onnxruntime", reason="runs it: pip install onnxruntime")
    file = policy.write(tmp_path / "balance.onnx")
    rule = control.ActionRule(outputs=policy.ACTION, low=-policy.LIMIT, high=policy.LIMIT)
    slot = control.Policy(file, inputs=policy.OBSERVATION, rule=rule)
    goal, _ = policy.PolicyBalance(slot.step).step(Estimator().standing, 1e-3)
    np.testing.assert_allclose(goal, body.STAND, atol=1e-6)
    assert np.isfinite(slot.step(np.full(policy.OBSERVATION, np.nan), 1.0)).all()


def test_an_unreliable_estimate_leaves_the_standing_pose() -> None:
    estimator = Estimator()
    measured = Measurement(body.STAND, np.zeros(33), np.full(4, np.nan), np.zeros(3))
    lost = estimator.step(measured, 1e-3)
    for law in (Lqr(), policy_balance()):
        goal, torque = law.step(lost, 1e-3)
        np.testing.assert_array_equal(goal, body.STAND)
        assert np.abs(torque).max() < 100.0

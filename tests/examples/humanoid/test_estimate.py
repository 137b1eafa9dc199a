"""The base of the humanoid is estimated from its sensors, with stated rules for lost ones."""

from __future__ import annotations

from typing import Any

import body
import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")

import mujoco
from estimate import Estimator, Measurement, fallen
from simulation import Plain, Push, Simulation

BOTH = np.array([[0.0, 0.0, -500.0], [0.0, 0.0, -482.0]])


@pytest.fixture(scope="module")
def estimator() -> Estimator:
    return Estimator()


@pytest.fixture
def standing(estimator: Estimator) -> Measurement:
    estimator.reset()
    zeros = np.zeros(33)
    return Measurement(body.STAND.copy(), zeros, np.array([1.0, 0, 0, 0]), np.zeros(3), BOTH.copy())


def turned(angle: float, axis: int) -> np.ndarray:
    quaternion, direction = np.zeros(4), np.eye(3)[axis]
    mujoco.mju_axisAngle2Quat(quaternion, direction, angle)
    return quaternion


def test_the_standing_pose(estimator: Estimator, standing: Measurement) -> None:
    found = estimator.step(standing, 1e-3)
    model = body.load_model()
    np.testing.assert_allclose(found.base_position, model.qpos0[:3], atol=1e-3)
    assert found.com[2] == pytest.approx(1.048, abs=0.01)
    np.testing.assert_allclose(found.load, [500.0, 482.0])
    assert found.tilt == pytest.approx(0.0)
    assert (found.lost, found.reliable) == ((), True)


def test_the_heading_of_the_imu_has_no_effect(estimator: Estimator, standing: Measurement) -> None:
    before = estimator.step(standing, 1e-3)
    standing.orientation = turned(2.0, 2)
    after = estimator.step(standing, 1e-3)
    np.testing.assert_allclose(after.com, before.com, atol=1e-9)
    np.testing.assert_allclose(after.orientation, before.orientation, atol=1e-9)


def test_a_turn_about_the_ankles_moves_the_centre_of_mass(
    estimator: Estimator, standing: Measurement
) -> None:
    """All joints keep their positions; the IMU turns forwards with 0.5 rad/s."""
    before = estimator.step(standing, 1e-3)
    standing.orientation = turned(0.05, 1)
    standing.gyro = np.array([0.0, 0.5, 0.0])
    estimator.reset()
    after = estimator.step(standing, 1e-3)
    assert after.com[0] - before.com[0] == pytest.approx(0.05 * before.com[2], rel=0.05)
    assert after.com_velocity[0] == pytest.approx(0.5 * before.com[2], rel=0.05)
    assert after.tilt == pytest.approx(0.05)


def test_the_loaded_foot_determines_the_velocity(
    estimator: Estimator, standing: Measurement
) -> None:
    """A lifted foot moves fast without moving the base."""
    standing.velocity[body.INDEX["left_knee"]] = 2.0
    standing.forces[0] = 0.0
    standing.forces[1] = 0.0, 0.0, -982.0
    found = estimator.step(standing, 1e-3)
    np.testing.assert_allclose(found.base_velocity, 0.0, atol=1e-9)


@pytest.mark.parametrize(("lost", "load"), [(0, [500.0, 482.0]), (1, [500.0, 482.0])])
def test_without_one_foot_sensor_the_foot_carries_the_rest(
    estimator: Estimator, standing: Measurement, lost: int, load: list[float]
) -> None:
    standing.forces[lost] = np.nan
    found = estimator.step(standing, 1e-3)
    np.testing.assert_allclose(found.load, load, atol=1.0)
    assert found.lost == (("left_foot", "right_foot")[lost],)
    assert found.reliable


def test_without_both_foot_sensors_each_foot_carries_half(
    estimator: Estimator, standing: Measurement
) -> None:
    standing.forces[:] = np.nan
    found = estimator.step(standing, 1e-3)
    np.testing.assert_allclose(found.load, estimator.weight / 2)
    assert found.lost == ("left_foot", "right_foot")
    assert found.reliable


@pytest.mark.parametrize(
    ("name", "field", "value"),
    [
        ("imu", "orientation", np.nan),
        ("imu", "orientation", 0.0),
        ("gyro", "gyro", np.nan),
        ("joints", "position", np.nan),
        ("joint velocities", "velocity", np.inf),
    ],
)
def test_without_the_imu_or_a_joint_the_estimate_is_not_reliable(
    estimator: Estimator, standing: Measurement, name: str, field: str, value: float
) -> None:
    """It keeps the last values, and is reliable again with the sensor."""
    before = estimator.step(standing, 1e-3)
    kept = getattr(standing, field)
    setattr(standing, field, np.full_like(kept, value))
    lost = estimator.step(standing, 1e-3)
    assert not lost.reliable
    assert name in lost.lost
    np.testing.assert_array_equal(lost.com, before.com)
    assert np.isfinite(lost.position).all()
    setattr(standing, field, kept)
    assert estimator.step(standing, 1e-3).reliable


def test_a_tilted_or_low_body_has_fallen(estimator: Estimator, standing: Measurement) -> None:
    assert fallen(estimator.step(standing, 1e-3), estimator.standing) == ""
    for side in body.SIDES:
        for name, angle in (("hip_pitch", -1.3), ("knee", 2.2), ("ankle_pitch", -0.9)):
            standing.position[body.INDEX[f"{side}_{name}"]] = angle
    assert "centre of mass" in fallen(estimator.step(standing, 1e-3), estimator.standing)
    standing.position[:] = body.STAND
    standing.orientation = turned(-0.6, 0)
    assert "tilted by 34 degrees" in fallen(estimator.step(standing, 1e-3), estimator.standing)


def test_the_estimate_follows_the_moving_body() -> None:
    """The centre of mass and its velocity are those of the simulation, while the soles rest."""
    found: list[Any] = []

    class Watch(Plain):
        def step(self, estimate: Any, dt: float) -> Any:
            found.append(estimate)
            return super().step(estimate, dt)

    run = Simulation().run(Watch(), 0.8, (Push((150.0, 60.0), 0.1, 0.1),))
    com = np.array([estimate.com for estimate in found[1 : len(run.time) + 1]])
    velocity = np.array([estimate.com_velocity for estimate in found[1 : len(run.time) + 1]])
    truth = np.gradient(run.com, run.time, axis=0)
    assert np.ptp(run.com[:, 0]) > 0.02
    np.testing.assert_allclose(com, run.com, atol=2e-3)
    np.testing.assert_allclose(velocity[20:], truth[20:], atol=0.02)

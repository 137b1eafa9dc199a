"""State of the humanoid's base from its own sensors: IMU, joints, and force sensors of the feet.

The IMU measures the orientation of the pelvis. The soles rest on the floor, so that the positions
of the joints determine the position of the pelvis above them. The velocity follows from the same
kinematics. Feet that carry no weight do not count. (Leg odometry, for example: Bloesch et al.,
State Estimation for Legged Robots, RSS 2012. This is its simplest case, without a filter.)

All results are in the frame of the feet: its origin is the middle between the soles, z is vertical,
and x is the mean direction of the feet. Therefore a drift of the IMU's heading has no effect.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import body
import mujoco
import numpy as np

GRAVITY = 9.81  # [m/s²]
SMOOTHING = 4e-3  # [s], time constant of the velocities
LIGHTEST = 0.05  # a foot that carries less than this part of the weight does not count
TILT, LOWEST = 0.5, 0.75  # [rad] of the pelvis; height of the CoM relative to the standing pose
UP = np.array([0.0, 0.0, 1.0])


def _lost(length: int) -> np.ndarray:
    return np.full(length, np.nan)


@dataclass(slots=True)
class Measurement:
    """Measured values. NaN marks a lost sensor.

    Attributes:
        position: (33,) [rad], in the order of `body.NAMES`.
        velocity: (33,) [rad/s].
        orientation: (4,) quaternion (w, x, y, z) of the pelvis.
        gyro: (3,) angular velocity in the frame of the pelvis [rad/s].
        forces: (2, 3) force at the left and right foot [N]; z is negative under load.
    """

    position: np.ndarray
    velocity: np.ndarray
    orientation: np.ndarray = field(default_factory=lambda: _lost(4))
    gyro: np.ndarray = field(default_factory=lambda: _lost(3))
    forces: np.ndarray = field(default_factory=lambda: np.full((2, 3), np.nan))


@dataclass(frozen=True, slots=True)
class Estimate:
    """State of the body in the frame of the feet.

    Attributes:
        position: Joints, (33,) [rad].
        velocity: Joints, (33,) [rad/s].
        base_position: Pelvis, (3,) [m].
        base_velocity: Pelvis, (3,) [m/s].
        orientation: Pelvis, (4,) quaternion (w, x, y, z).
        gyro: (3,) angular velocity in the frame of the pelvis [rad/s].
        com: Centre of mass, (3,) [m].
        com_velocity: (3,) [m/s].
        load: Vertical force of the left and right foot, (2,) [N].
        lost: Names of the lost sensors.
        reliable: False if the pose of the pelvis is unknown. The values are then the last ones.
    """

    position: np.ndarray
    velocity: np.ndarray
    base_position: np.ndarray
    base_velocity: np.ndarray
    orientation: np.ndarray
    gyro: np.ndarray
    com: np.ndarray
    com_velocity: np.ndarray
    load: np.ndarray
    lost: tuple[str, ...] = ()
    reliable: bool = True

    @property
    def tilt(self) -> float:
        """Angle between the pelvis and the vertical [rad]."""
        _, x, y, _ = self.orientation
        return float(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0)))


class Estimator:
    """Estimator of the base, with the smoothed velocities as its only memory.

    Lost sensors have these rules:

    - Force sensor of one foot: this foot carries the weight that the other one does not.
    - Both force sensors: each foot carries half of the weight.
    - IMU, or a joint: the estimate keeps its last values and is not `reliable`. The robot cannot
      balance without them, so that the program has to choose damping.

    Args:
        path: The MJCF file of the humanoid.
        smoothing: Time constant of the smoothed velocities [s].
    """

    def __init__(self, path: str | Path = body.MODEL, *, smoothing: float = SMOOTHING) -> None:
        self._model = body.load_model(path)
        self._data = mujoco.MjData(self._model)
        self._joints = body.position_indices(self._model)
        self._dofs = body.velocity_indices(self._model)
        self._soles = [self._model.site(f"{side}_sole").id for side in body.SIDES]
        self._pelvis = self._model.body("pelvis").id
        self.weight = float(self._model.body_mass.sum()) * GRAVITY  # [N]
        self._smoothing = smoothing
        self._smooth: np.ndarray | None = None
        stand = Measurement(
            body.STAND, np.zeros(len(body.STAND)), self._data.qpos[3:7], np.zeros(3)
        )
        self.standing = self._last = self.step(stand, 0.0)
        self.reset()

    def reset(self) -> None:
        """Forget all measurements: the estimate is the standing pose."""
        self._last, self._smooth = self.standing, None

    def step(self, measured: Measurement, dt: float) -> Estimate:
        """Return the state of the body.

        Args:
            measured: The values of all sensors.
            dt: Time since the previous step [s].
        """
        load, lost = self._load(measured.forces)
        lost += tuple(
            name
            for name, values in (
                ("imu", measured.orientation),
                ("gyro", measured.gyro),
                ("joints", measured.position),
                ("joint velocities", measured.velocity),
            )
            if not np.isfinite(values).all() or (name == "imu" and not values.any())
        )
        if any(name not in ("left_foot", "right_foot") for name in lost):
            return self._keep(load, lost)
        self._solve(measured)
        self._last = self._make(measured, load, lost, dt)
        return self._last

    def _keep(self, load: np.ndarray, lost: tuple[str, ...]) -> Estimate:
        last = self._last
        return Estimate(
            last.position,
            last.velocity,
            last.base_position,
            last.base_velocity,
            last.orientation,
            last.gyro,
            last.com,
            last.com_velocity,
            load,
            lost,
            reliable=False,
        )

    def _load(self, forces: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return the load of both feet (2,) [N], and the names of the lost sensors."""
        load = np.maximum(-forces[:, 2], 0.0)
        known = np.isfinite(forces).all(axis=1)
        lost = tuple(f"{side}_foot" for side, ok in zip(body.SIDES, known, strict=True) if not ok)
        if not known.any():
            load[:] = self.weight / 2
        elif lost:
            load[~known] = max(self.weight - float(load[known][0]), 0.0)
        return load, lost

    def _solve(self, measured: Measurement) -> None:
        """Compute the kinematics with the pelvis at the origin and without linear velocity."""
        data = self._data
        data.qpos[3:7] = measured.orientation / np.linalg.norm(measured.orientation)
        data.qpos[self._joints] = measured.position
        data.qvel[3:6] = measured.gyro
        data.qvel[self._dofs] = measured.velocity
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_comVel(self._model, data)
        mujoco.mj_subtreeVel(self._model, data)

    def _make(
        self, measured: Measurement, load: np.ndarray, lost: tuple[str, ...], dt: float
    ) -> Estimate:
        data = self._data
        soles = data.site_xpos[self._soles]
        heading = self._heading()
        frame = _turn(-heading)
        middle = soles.mean(axis=0)
        still = self._still(load)
        velocity = np.stack([-still, data.subtree_linvel[self._pelvis] - still]) @ frame.T
        base_velocity, com_velocity = self._smoothed(velocity, dt)
        half = np.array([np.cos(heading / 2), 0.0, 0.0, -np.sin(heading / 2)])
        orientation = np.empty(4)
        mujoco.mju_mulQuat(orientation, half, data.qpos[3:7])
        return Estimate(
            position=np.array(measured.position),
            velocity=np.array(measured.velocity),
            base_position=frame @ (data.qpos[:3] - middle),
            base_velocity=base_velocity,
            orientation=orientation,
            gyro=np.array(measured.gyro),
            com=frame @ (data.subtree_com[self._pelvis] - middle),
            com_velocity=com_velocity,
            load=load,
            lost=lost,
        )

    def _heading(self) -> float:
        """Return the mean heading of the feet [rad]."""
        forward = self._data.site_xmat[self._soles].reshape(2, 3, 3)[:, :, 0].sum(axis=0)
        return float(np.arctan2(forward[1], forward[0]))

    def _still(self, load: np.ndarray) -> np.ndarray:
        """Return the velocity of the soles relative to the pelvis (3,), weighted by their load."""
        share = np.where(load < LIGHTEST * self.weight, 0.0, load)
        share = share / share.sum() if share.any() else np.full(2, 0.5)
        result, total = np.empty(6), np.zeros(3)
        for sole, part in zip(self._soles, share.tolist(), strict=True):
            mujoco.mj_objectVelocity(
                self._model, self._data, mujoco.mjtObj.mjOBJ_SITE, sole, result, 0
            )
            total += part * result[3:]
        return total

    def _smoothed(self, velocity: np.ndarray, dt: float) -> np.ndarray:
        if self._smooth is None:
            self._smooth = velocity
        self._smooth = self._smooth + (velocity - self._smooth) * dt / (self._smoothing + dt)
        return self._smooth


def _turn(angle: float) -> np.ndarray:
    """Return the rotation about z by `angle` [rad], (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def fallen(estimate: Estimate, standing: Estimate) -> str:
    """Return the reason why the robot counts as fallen; empty while it stands.

    Args:
        estimate: The present state.
        standing: The state in the standing pose, `Estimator.standing`.
    """
    if estimate.tilt > TILT:
        return f"the pelvis is tilted by {np.degrees(estimate.tilt):.0f} degrees"
    if estimate.com[2] < LOWEST * standing.com[2]:
        return f"the centre of mass is at {estimate.com[2]:.2f} m"
    return ""

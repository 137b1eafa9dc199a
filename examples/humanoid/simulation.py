"""Simulation of the humanoid without a bus: laws at 4 kHz, balance at 1 kHz with a delay.

It models the pipeline of the program: every 250 us, the impedance law computes torques and limits
them. Every 1 ms, estimator and balance compute goals and torques, which act `DELAY` later.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import body
import mujoco
import numpy as np
from estimate import Estimate, Estimator, Measurement, fallen

LAW, BALANCE, DELAY = 250e-6, 1e-3, 2e-3  # [s]
ENCODER = 2 * np.pi / 2**17 / 100  # [rad] of the joint, resolution of an encoder at the motor
GRAVITY = 9.81  # [m/s²]
SENSED = ("imu_orientation", "imu_gyro", "left_foot_force", "right_foot_force")


class Control(Protocol):
    """Law of the balance, such as `Balance` and `Lqr`."""

    def step(self, estimate: Estimate, dt: float) -> tuple[np.ndarray, np.ndarray]: ...

    def reset(self) -> None: ...


class Plain:
    """Plain joint PD about the standing pose, with the gains of `body.py` and without torques."""

    def step(self, estimate: Estimate, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the goals (33,) [rad] and torques (33,) [N·m] of the joints."""
        return body.STAND, np.zeros(len(body.STAND))

    def reset(self) -> None:
        """Do nothing: plain PD has no memory."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations of the noise of the sensors.

    Attributes:
        orientation: Of the IMU [rad].
        gyro: Of the IMU [rad/s].
        velocity: Of the joints [rad/s].
        force: Of the feet [N].
        seed: Seed of the random numbers.
    """

    orientation: float = 1e-3
    gyro: float = 5e-3
    velocity: float = 5e-3
    force: float = 3.0
    seed: int = 1


@dataclass(frozen=True, slots=True)
class Push:
    """Force on the torso.

    Attributes:
        force: (x, y) [N].
        start: Start time [s].
        length: Duration [s].
    """

    force: tuple[float, float]
    start: float = 0.5
    length: float = np.inf

    def at(self, time: float) -> tuple[float, float]:
        """Return the force at `time` [s]."""
        return self.force if self.start <= time < self.start + self.length else (0.0, 0.0)


class Result(NamedTuple):
    """Result of one run.

    Attributes:
        fall: Reason and time of a fall; empty if the robot stands at the end.
        time: (samples,) [s].
        com: True centre of mass in the frame of the floor, (samples, 3) [m].
        torque: Torques of the drives, (samples, 33) [N·m].
        load: True vertical force of both feet, (samples, 2) [N].
    """

    fall: str
    time: np.ndarray
    com: np.ndarray
    torque: np.ndarray
    load: np.ndarray


class Simulation:
    """Simulated body with its sensors. `run` starts from the standing pose every time.

    Args:
        path: The MJCF file of the humanoid.
        tilt: Slope of the floor along (x, y) [rad]. The floor stays the plane z = 0, and gravity is
            turned instead. The IMU measures against gravity.
        noise: Noise of the sensors; None: exact sensors.
        lost: Names of sensors that `run` loses.
        stiffness: Stiffness of the impedance laws, (33,) [N·m/rad]; None: that of `body.py`.
    """

    def __init__(
        self,
        path: str | Path = body.MODEL,
        *,
        tilt: tuple[float, float] = (0.0, 0.0),
        noise: Noise | None = None,
        lost: tuple[str, ...] = (),
        stiffness: np.ndarray | None = None,
    ) -> None:
        self.model = body.load_model(path, step=LAW)
        self.model.opt.gravity[:] = _slope(tilt)
        self._vertical = _rotation_to_vertical(self.model.opt.gravity)
        self._estimator = Estimator(path)
        self._joints = body.position_indices(self.model)
        self._dofs = body.velocity_indices(self.model)
        self._torso = self.model.body("torso").id
        self._noise, self._lost = noise, lost
        self._stiffness = body.STIFFNESS if stiffness is None else stiffness

    def run(
        self, control: Control, seconds: float, pushes: tuple[Push, ...] = (), *, lose: float = 0.0
    ) -> Result:
        """Simulate until the robot falls or `seconds` have passed.

        Args:
            control: The law of the balance.
            seconds: Duration [s].
            pushes: Forces on the torso.
            lose: Time at which the lost sensors are lost [s].
        """
        data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, data)
        random = np.random.default_rng(self._noise.seed if self._noise else 0)
        estimator, every = self._estimator, round(BALANCE / LAW)
        estimator.reset()
        control.reset()
        pipeline = [control.step(estimator.standing, 0.0)] * round(DELAY / BALANCE)
        goal, torque = pipeline[0]
        rows: list[tuple[float, np.ndarray, np.ndarray, np.ndarray]] = []
        fall = ""
        for cycle in range(round(seconds / LAW)):
            if cycle % every == 0:
                found = estimator.step(self._measure(data, random, data.time >= lose), BALANCE)
                pipeline.append(control.step(found, BALANCE))
                goal, torque = pipeline.pop(0)
                rows.append(self._row(data))
                fall = fallen(found, estimator.standing)
            if fall:
                break
            self._step(data, goal, torque, pushes)
        return Result(fall, *(np.array(column) for column in zip(*rows, strict=True)))

    def _step(
        self, data: Any, goal: np.ndarray, torque: np.ndarray, pushes: tuple[Push, ...]
    ) -> None:
        """Step the law and the body."""
        error = goal - data.qpos[self._joints]
        wanted = torque + self._stiffness * error - body.DAMPING * data.qvel[self._dofs]
        data.qfrc_applied[self._dofs] = np.clip(wanted, -body.TORQUE, body.TORQUE)
        if pushes:
            data.xfrc_applied[self._torso, :2] = np.sum([p.at(data.time) for p in pushes], axis=0)
        mujoco.mj_step(self.model, data)

    def _row(self, data: Any) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        torque = data.qfrc_applied[self._dofs]
        load = [-data.sensor(f"{side}_foot_force").data[2] for side in body.SIDES]
        return float(data.time), data.subtree_com[0].copy(), torque, np.array(load)

    def _measure(self, data: Any, random: np.random.Generator, lose: bool) -> Measurement:
        """Return the values of the sensors, with noise and lost sensors."""
        values = {name: data.sensor(name).data.copy() for name in SENSED}
        mujoco.mju_mulQuat(
            values["imu_orientation"], self._vertical, values["imu_orientation"].copy()
        )
        position, velocity = data.qpos[self._joints], data.qvel[self._dofs]
        if noise := self._noise:
            position = np.round(position / ENCODER) * ENCODER
            velocity = velocity + random.normal(0, noise.velocity, velocity.shape)
            values["imu_orientation"] += random.normal(0, noise.orientation / 2, 4)
            values["imu_gyro"] += random.normal(0, noise.gyro, 3)
            for name in SENSED[2:]:
                values[name] += random.normal(0, noise.force, 3)
        for name in self._lost if lose else ():
            values[name][:] = np.nan
        orientation, gyro, left, right = values.values()
        return Measurement(position, velocity, orientation, gyro, np.stack([left, right]))


def _slope(tilt: tuple[float, float]) -> np.ndarray:
    """Return gravity (3,) [m/s²] in the frame of a floor that slopes down along x and y [rad]."""
    direction = np.array([np.tan(tilt[0]), np.tan(tilt[1]), -1.0])
    return GRAVITY * direction / np.linalg.norm(direction)


def _rotation_to_vertical(gravity: np.ndarray) -> np.ndarray:
    """Return the quaternion (4,) from the frame of the floor to a frame with vertical z."""
    up = -gravity / np.linalg.norm(gravity)
    turn = np.array([1 + up[2], *np.cross(up, [0.0, 0.0, 1.0])])
    return turn / np.linalg.norm(turn)

"""Balance by a linear-quadratic regulator with a predictor, as a comparison with `balance.py`.

`mujoco.mjd_transitionFD` linearises the standing body, with its contacts and with the impedance of
the joints. The state x (78,) has the differences from the standing pose: position and orientation
of the pelvis, joints, and their velocities. The input u (33,) is a torque in addition to the static
one. Dry friction is left out: at rest, it would hold all joints in the linear model.

The method is that of MuJoCo's LQR tutorial. A predictor accounts for the delay of the pipeline: it
advances the state by the model and the inputs that are still on their way (Smith predictor in state
space, for example Åström and Wittenmark, Computer-Controlled Systems).
"""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any

import body
import mujoco
import numpy as np
from estimate import Estimate, Estimator
from statics import Statics

DIFFERENCE = 1e-6  # of the finite differences
DIVERGED = 1e40  # growth of the costs at which the Riccati equation has no solution
COM_COST, TILT_COST, JOINT_COST, SPEED_COST = 4e3, 4e2, 4.0, 0.05
INPUT_COST = 4e-3  # at 100 N·m of the peak torque; other joints in proportion


class LinearModel:
    """Linear model of the standing body with the impedance of its joints.

    `state` maps an estimate to x. `transition` and `effect` are A (78, 78) and B (78, 33) of one
    `period`. `com` (2, 78) maps x to the horizontal error of the centre of mass.

    Args:
        path: The MJCF file of the humanoid.
        period: Sampling period [s].
        step: Time step of the linearisation [s], which divides the period.
    """

    def __init__(
        self, path: str | Path = body.MODEL, *, period: float = 1e-3, step: float = 1e-3
    ) -> None:
        statics = Statics(path)
        self.static_torque = statics.torque(body.STAND)
        self._model = actuated(path, step)
        self._dofs = body.velocity_indices(self._model)
        self._joints = body.position_indices(self._model)
        data = mujoco.MjData(self._model)
        data.qpos[2] = statics.place(body.STAND)
        data.ctrl[:] = self.static_torque + body.STIFFNESS * body.STAND
        one = self._differentiate(data)
        self.transition, self.effect = held(*one, round(period / step))
        self.com = self._com(data)
        self._reference = self._position(Estimator(path).standing)

    def _differentiate(self, data: Any) -> tuple[np.ndarray, np.ndarray]:
        size, inputs = 2 * self._model.nv, self._model.nu
        a, b = np.zeros((size, size)), np.zeros((size, inputs))
        mujoco.mjd_transitionFD(self._model, data, DIFFERENCE, True, a, b, None, None)
        return a, b

    def _com(self, data: Any) -> np.ndarray:
        jacobian = np.zeros((3, self._model.nv))
        mujoco.mj_forward(self._model, data)
        mujoco.mj_jacSubtreeCom(self._model, data, jacobian, 0)
        return np.hstack([jacobian[:2], np.zeros((2, self._model.nv))])

    def _position(self, estimate: Estimate) -> np.ndarray:
        position = np.empty(self._model.nq)
        position[:3], position[3:7] = estimate.base_position, estimate.orientation
        position[self._joints] = estimate.position
        return position

    def state(self, estimate: Estimate) -> np.ndarray:
        """Return the difference from the standing pose, x (78,)."""
        degrees = self._model.nv
        x = np.zeros(2 * degrees)
        position = self._position(estimate)
        mujoco.mj_differentiatePos(self._model, x[:degrees], 1.0, self._reference, position)
        x[degrees : degrees + 3] = estimate.base_velocity
        x[degrees + 3 : degrees + 6] = estimate.gyro
        x[degrees + self._dofs] = estimate.velocity
        return x

    def cost(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the cost of the state (78, 78) and of the input (33, 33) per period."""
        degrees = self._model.nv
        weights = np.full(2 * degrees, SPEED_COST)
        weights[:degrees] = JOINT_COST
        weights[3:6] = TILT_COST
        state = np.diag(weights) + COM_COST * self.com.T @ self.com
        return state, np.diag(INPUT_COST * (100.0 / body.TORQUE) ** 2)


def actuated(path: str | Path, step: float) -> Any:
    """Return the mjModel with the impedance laws as actuators, whose inputs are K·goal + torque.

    Args:
        path: The MJCF file of the humanoid.
        step: Time step [s].
    """
    spec = mujoco.MjSpec.from_file(str(path))
    for joint in body.JOINTS:
        actuator = spec.add_actuator(name=joint.name, target=joint.name)
        actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
        actuator.gaintype, actuator.gainprm[0] = mujoco.mjtGain.mjGAIN_FIXED, 1.0
        actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.biasprm[1:3] = -joint.stiffness, -joint.damping
    model = spec.compile()
    dofs = body.velocity_indices(model)
    model.dof_armature[dofs] += body.ARMATURE
    model.dof_damping[dofs] += body.VISCOUS
    model.opt.timestep = step
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def held(a: np.ndarray, b: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the linear model over several steps with a constant input.

    Args:
        a: (n, n) transition of one step.
        b: (n, m) effect of the input in one step.
        steps: Number of steps.
    """
    transition, effect = np.eye(len(a)), np.zeros_like(b)
    for _ in range(steps):
        transition, effect = a @ transition, a @ effect + b
    return transition, effect


def riccati(a: np.ndarray, b: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Return the feedback (m, n) of the discrete LQR, by structure-preserving doubling.

    The method is that of Chu, Fan, Lin and Wang (International Journal of Control, 2004). It
    converges quadratically.

    Args:
        a: (n, n) transition.
        b: (n, m) effect of the input.
        q: (n, n) cost of the state.
        r: (m, m) cost of the input.

    Raises:
        ValueError: The iteration does not converge, since b cannot stabilise a.
    """
    identity = np.eye(len(a))
    e, g, h = a, b @ np.linalg.solve(r, b.T), q
    for _ in range(50):
        left = np.linalg.solve((identity + g @ h).T, e.T).T  # e (1 + g h)^-1
        right = np.linalg.solve(identity + g @ h, e)
        grown = h + e.T @ h @ right
        if np.abs(grown).max() > DIVERGED * np.abs(q).max():
            break
        g, e = g + left @ g @ e.T, left @ e
        done = np.abs(grown - h).max() <= 1e-10 * np.abs(grown).max()
        h = (grown + grown.T) / 2
        if done:
            return np.linalg.solve(r + b.T @ h @ b, b.T @ h @ a)
    raise ValueError("the Riccati equation has no solution: the inputs cannot stabilise the model")


class Lqr:
    """Linear-quadratic regulator with a predictor. Its memory has the inputs on their way.

    It has the interface of `balance.Balance`.

    Args:
        path: The MJCF file of the humanoid.
        period: Period of `step` [s].
        delay: Delay of the goals and torques that the predictor compensates [s].
    """

    def __init__(
        self, path: str | Path = body.MODEL, *, period: float = 1e-3, delay: float = 2e-3
    ) -> None:
        self.model = LinearModel(path, period=period)
        self.feedback = riccati(self.model.transition, self.model.effect, *self.model.cost())
        self.goal = body.STAND.copy()
        self._inputs: deque[np.ndarray] = deque(maxlen=round(delay / period))
        self.reset()

    def step(self, estimate: Estimate, dt: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the goals (33,) [rad] and torques (33,) [N·m] of the joints.

        The torques are those of the standing pose while the estimate is not reliable.

        Args:
            estimate: State of the body.
            dt: Time since the previous step [s]; the regulator assumes its period.
        """
        if not estimate.reliable:
            self.reset()
            return self.goal.copy(), self.model.static_torque.copy()
        x = self.model.state(estimate)
        for u in self._inputs:
            x = self.model.transition @ x + self.model.effect @ u
        u = np.clip(-self.feedback @ x, -body.TORQUE, body.TORQUE)
        self._inputs.append(u)
        return self.goal.copy(), self.model.static_torque + u

    def reset(self) -> None:
        """Forget the inputs on their way."""
        self._inputs.extend([np.zeros(len(body.STAND))] * (self._inputs.maxlen or 0))

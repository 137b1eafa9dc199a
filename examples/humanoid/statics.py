"""Torques that hold the humanoid in a pose, and torques that push its centre of mass.

Both follow from the equation of motion with contact wrenches λ of the feet (Jᵀλ):

    joint torques, base wrench 0  =  required generalised forces  -  Jᵀλ

The six rows of the base determine λ, up to the distribution between the feet. Weighted least
squares choose it. The rows of the joints then are the torques.
"""

from __future__ import annotations

from pathlib import Path

import body
import mujoco
import numpy as np

HEIGHTS = (-0.01, 0.01)  # [m] from the start, range in which the floor carries the weight
# Largest wrench of a sole relative to its load: friction, load, and half the size of the sole [m].
# The moments are cheap in proportion to them.
EXTENT = np.array([1.0, 1.0, 1.0, 0.06, 0.12, 0.05])


class Statics:
    """Torques for standing in a pose on both feet.

    Args:
        path: The MJCF file of the humanoid.
    """

    def __init__(self, path: str | Path = body.MODEL) -> None:
        self._model = body.load_model(path)
        self._data = mujoco.MjData(self._model)
        self._joints = body.position_indices(self._model)
        self._dofs = body.velocity_indices(self._model)
        self.mass = float(self._model.body_mass.sum())  # [kg]

    def place(self, pose: np.ndarray) -> float:
        """Put the model into a pose, at the height at which the floor carries its weight.

        MuJoCo's contacts are soft, so that the force depends on the height. This is the method of
        MuJoCo's LQR tutorial: the vertical residual of the free joint vanishes at this height.

        Args:
            pose: Joints, (33,) [rad].

        Returns:
            The height of the pelvis [m].

        Raises:
            ValueError: The soles are not flat on the floor in this pose.
        """
        data = self._data
        mujoco.mj_resetData(self._model, data)
        data.qpos[self._joints] = pose
        mujoco.mj_kinematics(self._model, data)
        sole = min(data.site(f"{side}_sole").xpos[2] for side in body.SIDES)
        start = data.qpos[2] - sole
        low, high = (start + each for each in HEIGHTS)
        if not self._residual(low) < 0 < self._residual(high):
            raise ValueError(
                "the floor does not carry the robot in this pose; both soles have to be flat on it"
            )
        while high - low > 1e-9:
            middle = (low + high) / 2
            low, high = (middle, high) if self._residual(middle) < 0 else (low, middle)
        return high

    def _residual(self, height: float) -> float:
        """Return the vertical force that the base needs in addition to the contacts [N]."""
        data = self._data
        data.qpos[2] = height
        mujoco.mj_forward(self._model, data)
        data.qacc[:] = 0
        mujoco.mj_inverse(self._model, data)
        return float(data.qfrc_inverse[2])

    def torque(self, pose: np.ndarray) -> np.ndarray:
        """Return the torques that hold a pose, (33,) [N·m]; `place` describes the arguments."""
        self._residual(self.place(pose))
        return self._resolve(self._data.qfrc_inverse)

    def push(self, pose: np.ndarray) -> np.ndarray:
        """Return the torques (33, 2) [N·m/N] that push the centre of mass along x and y."""
        self._residual(self.place(pose))
        jacobian = np.zeros((3, self._model.nv))
        mujoco.mj_jacSubtreeCom(self._model, self._data, jacobian, 0)
        return np.stack([self._resolve(jacobian[axis]) for axis in (0, 1)], axis=1)

    def _resolve(self, forces: np.ndarray) -> np.ndarray:
        """Return joint torques that have the effect of generalised forces (39,), without a base."""
        contacts, extent = self._contacts(), np.tile(EXTENT, 2)
        part = np.linalg.lstsq(contacts[:, :6].T * extent, forces[:6], rcond=None)[0]
        return forces[self._dofs] - contacts[:, self._dofs].T @ (extent * part)

    def _contacts(self) -> np.ndarray:
        """Return the Jacobian of force and moment at both soles, (12, 39)."""
        rows = []
        for side in body.SIDES:
            both = np.zeros((2, 3, self._model.nv))
            mujoco.mj_jacSite(
                self._model, self._data, both[0], both[1], self._data.site(f"{side}_sole").id
            )
            rows += [*both[0], *both[1]]
        return np.array(rows)

"""Kinematics of an arm from its MJCF or URDF file, computed by MuJoCo (extra `sim`)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from catenary.control.model import load_model
from catenary.errors import ConfigurationError
from catenary.ros2.spline import Row

ITERATIONS = 100
LINEAR, ANGULAR = 1e-5, 1e-4  # [m], [rad] tolerances of a solution
DAMPING = 1e-4  # smallest square of the damping factor


class Pose(NamedTuple):
    """Position (3,) [m] and orientation as a unit quaternion (w, x, y, z)."""

    position: Row
    quaternion: Row


class Kinematics:
    """Forward, differential and inverse kinematics of one point of an arm.

    Poses are in the world frame of the model. Joint limits are those of the model.

    Args:
        path: MJCF or URDF file.
        site: name of the site, or of the body, that moves to a pose.
        joints: names of the joints, in the order of the axes; None for all.
        axes: required number of joints; None for any.

    Raises:
        ConfigurationError: MuJoCo, the file, a joint or the site is missing, or the file is not a
            valid model.
    """

    def __init__(
        self,
        path: str | Path,
        site: str,
        *,
        joints: Sequence[str] | None = None,
        axes: int | None = None,
    ) -> None:
        self._model = load_model(Path(path), joints, axes, 0.0)
        self._data = self._model.workspace()
        native = self._model.native
        self._coordinates, self._degrees = np.array(self._model.places).T
        self._jacobian, self._point, self._number = self._place(Path(path), site)
        named = [native.joint(name) for name in self._model.joints]
        limited = np.array([bool(joint.limited[0]) for joint in named])
        ranges = np.array([joint.range for joint in named], dtype=np.float64)
        self.position_min: Row = np.where(limited, ranges[:, 0], -np.inf)
        self.position_max: Row = np.where(limited, ranges[:, 1], np.inf)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the axes."""
        return self._model.joints

    def _place(self, path: Path, name: str) -> tuple[Any, tuple[Row, Row], int]:
        """Return the Jacobian function, the rows of positions and matrices, and the number."""
        native, data, mujoco = self._model.native, self._data, self._model.mujoco
        sites = [native.site(k).name for k in range(native.nsite)]
        bodies = [native.body(k).name for k in range(native.nbody)]
        if name in sites:
            number = int(native.site(name).id)
            return mujoco.mj_jacSite, (data.site_xpos, data.site_xmat), number
        if name in bodies:
            return mujoco.mj_jacBody, (data.xpos, data.xmat), int(native.body(name).id)
        known = ", ".join([*sites, *bodies])
        raise ConfigurationError(
            f"{path}: the model has no site or body {name!r}", hint=f"it has {known}"
        )

    def pose(self, position: Row) -> Pose:
        """Return the pose of the site at the joint positions (n,) [rad]."""
        mujoco = self._model.mujoco
        self._data.qpos[self._coordinates] = position
        mujoco.mj_kinematics(self._model.native, self._data)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, self._point[1][self._number])
        return Pose(self._point[0][self._number].copy(), quaternion)

    def jacobian(self, position: Row) -> Row:
        """Return the Jacobian (6, n) at the joint positions (n,): linear rows, then angular."""
        mujoco, native = self._model.mujoco, self._model.native
        self._data.qpos[self._coordinates] = position
        mujoco.mj_kinematics(native, self._data)
        mujoco.mj_comPos(native, self._data)
        linear, angular = np.zeros((3, native.nv)), np.zeros((3, native.nv))
        self._jacobian(native, self._data, linear, angular, self._number)
        rows: Row = np.vstack([linear, angular])[:, self._degrees]
        return rows

    def error(self, target: Pose, actual: Pose) -> Row:
        """Return the twist (6,) that leads from a pose to another in 1 s [m, rad].

        Args:
            target: pose at the end.
            actual: pose at the start.
        """
        mujoco = self._model.mujoco
        inverse, change, rotation = np.zeros(4), np.zeros(4), np.zeros(3)
        mujoco.mju_negQuat(inverse, actual.quaternion)
        mujoco.mju_mulQuat(change, target.quaternion, inverse)
        mujoco.mju_quat2Vel(rotation, change, 1.0)
        return np.concatenate([target.position - actual.position, rotation])

    def solve(self, target: Pose, start: Row) -> Row | None:
        """Return joint positions (n,) at which the site has a pose; None if none is found.

        The search stays within the joint limits and begins at `start`.

        Args:
            target: pose of the site.
            start: joint positions (n,) [rad].

        Source: Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt
        method, IEEE Transactions on Robotics, 2011.
        """
        position = np.clip(start, self.position_min, self.position_max)
        for _ in range(ITERATIONS):
            error = self.error(target, self.pose(position))
            if reached(error):
                return position
            damping = DAMPING + float(error @ error) / 2
            change = damped(self.jacobian(position), error, damping)
            position = np.clip(position + change, self.position_min, self.position_max)
        return None


def reached(error: Row, linear: float = LINEAR, angular: float = ANGULAR) -> bool:
    """Return True if a pose is reached.

    Args:
        error: difference of two poses (6,) [m, rad].
        linear: tolerance of the position [m].
        angular: tolerance of the orientation [rad].
    """
    return bool(np.linalg.norm(error[:3]) <= linear and np.linalg.norm(error[3:]) <= angular)


def damped(jacobian: Row, twist: Row, damping: float) -> Row:
    """Return the joint velocities (n,) of a twist, by damped least squares.

    Args:
        jacobian: (6, n).
        twist: (6,) [m/s, rad/s].
        damping: square of the damping factor.

    Source: Nakamura and Hanafusa, Inverse kinematic solutions with singularity robustness, 1986.
    """
    square = jacobian @ jacobian.T + damping * np.eye(len(jacobian))
    rates: Row = jacobian.T @ np.linalg.solve(square, twist)
    return rates


def condition(jacobian: Row) -> float:
    """Return the ratio of the largest to the smallest singular value of a Jacobian (6, n)."""
    values = np.linalg.svd(jacobian, compute_uv=False)
    return float("inf") if len(values) < 6 or values[-1] == 0 else float(values[0] / values[-1])

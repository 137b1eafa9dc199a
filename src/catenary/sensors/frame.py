"""Frame of a sensor on a machine: vectors and wrenches in another frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Frame:
    """Pose of the frame of a sensor in a target frame, such as that of the tool.

    Args:
        rotation: rotation matrix from the sensor to the target, shape (3, 3).
        translation: origin of the sensor in the target frame [m], shape (3,).

    Raises:
        ValueError: a shape is wrong, a number is not finite, or the matrix is not a rotation.
    """

    rotation: Array
    translation: Array

    def __init__(
        self, rotation: npt.ArrayLike | None = None, translation: npt.ArrayLike = (0.0, 0.0, 0.0)
    ) -> None:
        turn = np.eye(3) if rotation is None else np.array(rotation, np.float64)
        origin = np.array(translation, np.float64)
        if turn.shape != (3, 3) or origin.shape != (3,):
            raise ValueError(
                f"rotation has shape {turn.shape}, translation {origin.shape}: must be (3, 3), (3,)"
            )
        if not (np.isfinite(turn).all() and np.isfinite(origin).all()):
            raise ValueError("rotation and translation must be finite")
        orthogonal = np.allclose(turn @ turn.T, np.eye(3), atol=TOLERANCE)
        if not orthogonal or np.linalg.det(turn) < 0:
            raise ValueError("rotation is not a rotation matrix")
        object.__setattr__(self, "rotation", turn)
        object.__setattr__(self, "translation", origin)

    @classmethod
    def from_quaternion(
        cls, quaternion: Sequence[float], translation: npt.ArrayLike = (0.0, 0.0, 0.0)
    ) -> Frame:
        """Return the frame with a rotation as a quaternion in the order of ROS, (x, y, z, w).

        Args:
            quaternion: rotation; it is normalised.
            translation: origin of the sensor in the target frame [m].

        Raises:
            ValueError: the quaternion does not have four finite numbers, or is zero.
        """
        given = np.array(quaternion, np.float64)
        if given.shape != (4,) or not np.isfinite(given).all() or not given.any():
            raise ValueError(f"{quaternion}: must be four finite numbers (x, y, z, w), not all 0")
        x, y, z, w = given / np.linalg.norm(given)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return cls(np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross, translation)

    def inverse(self) -> Frame:
        """Return the pose of the target frame in the frame of the sensor."""
        return Frame(self.rotation.T, -self.rotation.T @ self.translation)

    def vector(self, value: npt.ArrayLike) -> Array:
        """Return a free vector in the target frame, such as an acceleration, shape (3,)."""
        result: Array = self.rotation @ np.asarray(value, np.float64)
        return result

    def wrench(self, force: npt.ArrayLike, torque: npt.ArrayLike) -> tuple[Array, Array]:
        """Return force and torque at the origin of the target frame, and in its axes.

        The torque becomes R·τ + p × R·f.

        Args:
            force: force at the origin of the sensor [N], shape (3,).
            torque: torque at the origin of the sensor [N·m], shape (3,).
        """
        moved = self.vector(force)
        return moved, self.vector(torque) + np.cross(self.translation, moved)

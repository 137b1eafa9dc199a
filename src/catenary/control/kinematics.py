"""Forward kinematics and Jacobian of a point of an arm, for Python and for laws."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from catenary.control.chain import Chain, Matrix, read_chain
from catenary.control.compiles import Row, compiles
from catenary.control.dynamics import Vector
from catenary.control.model import Model, load_model

KIND = 16.0
# layout of the memory: kind, counts, fixed step to the point, joints, then the work area
AXES, JOINTS, END, FIRST = 1, 2, 3, 15
JOINT = 18  # axis, slides, reference, step (12), direction (3)
STEP, DIRECTION = 3, 15
# layout of the work area: pose (12), displacement of a joint (12), solver (42), columns (6 each)
DISPLACEMENT, SOLVER, COLUMNS = 12, 24, 66
MATRIX = 36


class Kinematics:
    """Pose and velocity of a point of an arm, from an MJCF or URDF file.

    The pose is that of a site or body relative to a frame: the world, or a body that carries the
    point. Choose a body after the free joint for a robot with a floating base, such as its pelvis.

    Args:
        path: MJCF or URDF file.
        point: name of a site or body; a site if both have this name.
        frame: name of the body in whose axes poses are given; "world" for the world.
        joints: names of the joints, in the order of the axes. None means all joints, in the order
            of the model. Joints that are not named stay at their initial positions. Joints that do
            not move the point are allowed.
        axes: required number of joints; None for any.

    Raises:
        ConfigurationError: MuJoCo is not installed, the file is not a valid model, a name is
            missing, the frame does not carry the point, no axis moves the point, or a free or ball
            joint is between them.

    MuJoCo only reads the file. A law computes the pose from the joints between frame and point.
    """

    def __init__(
        self,
        path: str | Path,
        point: str,
        *,
        frame: str = "world",
        joints: Sequence[str] | None = None,
        axes: int | None = None,
    ) -> None:
        self._rebuild = partial(Kinematics, path, point, frame=frame, joints=joints, axes=axes)
        model: Model = load_model(Path(path), joints, axes, 0.0, fixed_links=True)
        self._joints = model.joints
        self._row = rows(read_chain(model, Path(path), point, frame), len(model.joints))

    def __reduce__(self) -> tuple[partial[Kinematics], tuple[()]]:
        return self._rebuild, ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the axes."""
        return self._joints

    @property
    def memory(self) -> Row:
        """Row for the memory of a law: the chain of joints, and its work area."""
        return self._row.copy()

    def pose(self, position: Vector) -> Row:
        """Return the pose (7,) at `position` (n,) [rad]: x, y, z [m], quaternion w, x, y, z.

        Raises:
            ValueError: `position` does not have one number per joint.
        """
        found = np.empty(7)
        pose(self._row, self._checked(position), found)
        return found

    def jacobian(self, position: Vector) -> Matrix:
        """Return the Jacobian (6, n) at `position` (n,) [rad].

        The rows are the velocity of the point [m/s] and its angular velocity [rad/s], in the axes
        of the frame.

        Raises:
            ValueError: `position` does not have one number per joint.
        """
        found = np.empty(6 * len(self.joints))
        jacobian(self._row, self._checked(position), found)
        return found.reshape(6, -1)

    def _checked(self, position: Vector) -> Row:
        row = np.array(position, dtype=np.float64)
        if row.shape != (len(self.joints),):
            raise ValueError(
                f"position has shape {row.shape}; give one number for each of the "
                f"{len(self.joints)} joints ({', '.join(self.joints)})"
            )
        return row


def rows(chain: Chain, axes: int) -> npt.NDArray[np.float64]:
    """Return a chain and its work area as the memory of a law."""
    joints = [joint.row for joint in chain.joints]
    work = np.zeros(COLUMNS + 6 * len(joints))
    return np.concatenate([[KIND, axes, len(joints)], chain.end.row, *joints, work])


@compiles
def pose(memory: Row, position: Row, out: Row) -> None:
    """Compute the pose of the point relative to the frame.

    Args:
        memory: `Kinematics.memory`.
        position: (n,) [rad].
        out: output (7,): x, y, z [m], then the unit quaternion w, x, y, z.

    Raises:
        ValueError: `memory` belongs to a different block, or its number of joints differs from the
            length of `position`.
    """
    work = forward(memory, position)
    for k in range(3):
        out[k] = memory[work + 9 + k]
    quaternion(memory, work, out, 3)


@compiles
def jacobian(memory: Row, position: Row, out: Row) -> None:
    """Compute the Jacobian of the point, in the axes of the frame.

    Args:
        memory: `Kinematics.memory`.
        position: (n,) [rad].
        out: output (6 · n,): the rows x, y, z [m/rad], then the rotations about x, y, z [rad/rad],
            each with n numbers.

    Raises:
        ValueError: `memory` belongs to a different block, or its number of joints differs from the
            length of `position`.
    """
    work = forward(memory, position)
    n = len(position)
    for k in range(6 * n):
        out[k] = 0.0
    for j in range(int(memory[JOINTS])):
        axis = int(memory[FIRST + JOINT * j])
        for k in range(6):
            out[k * n + axis] = memory[work + COLUMNS + 6 * j + k]


@compiles
def forward(memory: Row, position: Row) -> int:
    """Compute the pose and the columns of the Jacobian in the work area.

    Return the start of the work area. Raise ValueError as `pose` does.
    """
    if memory[0] != KIND:
        raise ValueError("not the memory of a Kinematics")
    if memory[AXES] != len(position):
        raise ValueError("the number of joints of the model differs from the number of axes")
    count = int(memory[JOINTS])
    work = FIRST + JOINT * count
    for k in range(DISPLACEMENT):
        memory[work + k] = 1.0 if k in (0, 4, 8) else 0.0
    for j in range(count):
        joint = FIRST + JOINT * j
        move(memory, work, joint + STEP)
        keep_axis(memory, work, joint, work + COLUMNS + 6 * j)
        displace(memory, joint, work + DISPLACEMENT, position[int(memory[joint])])
        move(memory, work, work + DISPLACEMENT)
    move(memory, work, END)
    for j in range(count):
        make_column(memory, work, FIRST + JOINT * j, work + COLUMNS + 6 * j)
    return work


@compiles
def move(memory: Row, here: int, step: int) -> None:
    """Multiply the pose at `here` by that at `step`: rotation by rows, then translation."""
    for i in range(3):
        a, b, c = memory[here + 3 * i], memory[here + 3 * i + 1], memory[here + 3 * i + 2]
        for j in range(3):
            turned = a * memory[step + j] + b * memory[step + 3 + j] + c * memory[step + 6 + j]
            memory[here + 3 * i + j] = turned
        moved = a * memory[step + 9] + b * memory[step + 10] + c * memory[step + 11]
        memory[here + 9 + i] += moved


@compiles
def keep_axis(memory: Row, work: int, joint: int, column: int) -> None:
    """Store the direction and the anchor of a joint, in the axes of the frame."""
    for i in range(3):
        total = 0.0
        for j in range(3):
            total += memory[work + 3 * i + j] * memory[joint + DIRECTION + j]
        memory[column + i] = total
        memory[column + 3 + i] = memory[work + 9 + i]


@compiles
def displace(memory: Row, joint: int, step: int, position: float) -> None:
    """Write the displacement of a joint: a rotation (Rodrigues), or a translation."""
    moved = position - memory[joint + 2]
    slides = memory[joint + 1] == 1.0
    length = moved if slides else 0.0
    c = 1.0 if slides else math.cos(moved)
    s = 0.0 if slides else math.sin(moved)
    d = (memory[joint + DIRECTION], memory[joint + DIRECTION + 1], memory[joint + DIRECTION + 2])
    for i in range(3):
        for j in range(3):
            memory[step + 3 * i + j] = (1.0 - c) * d[i] * d[j]
        memory[step + 4 * i] += c
        memory[step + 9 + i] = length * d[i]
    for k in range(3):  # plus sin times the cross-product matrix of the direction
        memory[step + (7, 2, 3)[k]] += s * d[k]
        memory[step + (5, 6, 1)[k]] -= s * d[k]


@compiles
def make_column(memory: Row, work: int, joint: int, column: int) -> None:
    """Replace the direction and the anchor of a joint by its column of the Jacobian."""
    x, y, z = memory[column], memory[column + 1], memory[column + 2]
    a = memory[work + 9] - memory[column + 3]
    b = memory[work + 10] - memory[column + 4]
    c = memory[work + 11] - memory[column + 5]
    if memory[joint + 1] == 1.0:
        for k in range(3):
            memory[column + 3 + k] = 0.0
    else:
        memory[column + 3], memory[column + 4], memory[column + 5] = x, y, z
        memory[column], memory[column + 1], memory[column + 2] = (
            y * c - z * b,
            z * a - x * c,
            x * b - y * a,
        )


@compiles
def quaternion(memory: Row, at: int, out: Row, first: int) -> None:
    """Write the unit quaternion of a rotation matrix (by rows) to `out[first:first + 4]`.

    The largest of the four components is computed first (Shepperd 1978), since its square root is
    then well conditioned. The result has w ≥ 0.
    """
    xx, yy, zz = memory[at], memory[at + 4], memory[at + 8]
    values = (1.0 + xx + yy + zz, 1.0 + xx - yy - zz, 1.0 - xx + yy - zz, 1.0 - xx - yy + zz)
    largest = 0
    for k in range(1, 4):
        if values[k] > values[largest]:
            largest = k
    wx, wy, wz = (
        memory[at + 7] - memory[at + 5],
        memory[at + 2] - memory[at + 6],
        memory[at + 3] - memory[at + 1],
    )
    xy, xz, yz = (
        memory[at + 1] + memory[at + 3],
        memory[at + 2] + memory[at + 6],
        memory[at + 5] + memory[at + 7],
    )
    size = math.sqrt(values[largest])
    part = 0.5 / size
    w = 0.5 * size if largest == 0 else part * (wx, wx, wy, wz)[largest]
    x = 0.5 * size if largest == 1 else part * (wx, wx, xy, xz)[largest]
    y = 0.5 * size if largest == 2 else part * (wy, xy, xy, yz)[largest]
    z = 0.5 * size if largest == 3 else part * (wz, xz, yz, yz)[largest]
    sign = -1.0 if w < 0.0 else 1.0
    out[first], out[first + 1], out[first + 2], out[first + 3] = (
        sign * w,
        sign * x,
        sign * y,
        sign * z,
    )

"""Cartesian impedance: a spring and a damper between a point of an arm and its goal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.kinematics import COLUMNS, FIRST, JOINT, JOINTS, SOLVER, forward, quaternion
from catenary.control.null_space import AXIS, DAMPING, GAINS, LIMITS, STIFFNESS, project
from catenary.control.parts import PerAxis, axis_count, checked, computed_once
from catenary.control.pid import limited

KIND = 13.0


@dataclass(frozen=True)
class CartesianImpedance:
    """Settings of a Cartesian impedance controller, τ = Jᵀ (K Δx + B Δẋ).

    Δx has the position error [m] and the orientation error as a rotation vector [rad], both in the
    axes of the frame of the `Kinematics`. The spring acts between this frame and the point. The
    torque contains neither gravity nor friction: add them, for example with `gravity`.

    `stiffness` and `damping` are one number for x, y and z, three numbers, or six numbers. The last
    three of six belong to rotations about x, y and z. Otherwise the orientation is free.

    Args:
        axes: number of axes.
        stiffness: K, three values [N/m], then three [N·m/rad].
        damping: B, three values [N·s/m], then three [N·m·s/rad].
        force: largest force of spring and damper together [N]. The direction is kept.
        moment: largest moment of spring and damper together [N·m]. The direction is kept.
        limit: largest torque of each axis, in both directions [N·m]. An axis at its limit changes
            the direction of the force.
        null_damping: damping of motions that do not move the point [N·m·s/rad], one value, or one
            per axis. The projection (I - Jᵀ (J Jᵀ)⁻¹ J) is kinematic. Therefore it is without force
            at the point when the arm is at rest, but not while it accelerates.

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.

    The rotation vector is the shortest rotation to the goal. It changes its direction at an error
    of 180°, so keep orientation errors well below. Near a singularity, no torque can produce a
    force in the lost direction. The torque stays finite there, since J is not inverted.

    Source: Hogan, Impedance control, ASME J. Dyn. Sys. Meas. Control 107, 1985; Ott, Cartesian
    impedance control of redundant and flexible-joint robots, Springer 2008; Dietrich, Ott and
    Albu-Schäffer, An overview of null space projections for redundant, torque-controlled robots,
    IJRR 34(11), 2015 (projections).
    """

    axes: int
    stiffness: PerAxis
    damping: PerAxis
    force: float = math.inf
    moment: float = math.inf
    limit: PerAxis = math.inf
    null_damping: PerAxis = 0.0

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (15 + 2 · axes,): the stiffness from 1, the damping from 7."""
        n = axis_count(self.axes)
        springs = directions("stiffness", self.stiffness), directions("damping", self.damping)
        limits = [checked(name, getattr(self, name), 1, above=True) for name in ("force", "moment")]
        per_axis = (
            checked("limit", self.limit, n, above=True),
            checked("null_damping", self.null_damping, n),
        )
        return np.concatenate([[KIND], *springs, *limits, np.column_stack(per_axis).ravel()])


def directions(name: str, value: PerAxis) -> Row:
    """Return an option as six numbers. One or three numbers are those of the translation.

    Raises ValueError if the number of values is wrong, or a value is NaN or negative.
    """
    row = np.array(value, dtype=np.float64)
    if row.ndim > 1 or row.size not in (1, 3, 6):
        raise ValueError(f"{name} has shape {row.shape}; give 1, 3 or 6 numbers")
    if row.size == 6:
        return checked(name, row, 6)
    return np.concatenate([checked(name, row, 3), np.zeros(3)])


@compiles
def cartesian_impedance(
    memory: Row,
    parameters: Row,
    goal: Row,
    goal_velocity: Row,
    position: Row,
    velocity: Row,
    torque: Row,
) -> None:
    """Compute the torques of all axes.

    Args:
        memory: `Kinematics.memory` of the point.
        parameters: `CartesianImpedance.parameters`.
        goal: pose (7,) as that of `pose`: x, y, z [m], quaternion w, x, y, z.
        goal_velocity: velocity of the goal (6,) [m/s] and [rad/s], in the axes of the frame.
        position: measured positions (n,) [rad].
        velocity: measured velocities (n,) [rad/s].
        torque: output, (n,) [N·m].

    Raises:
        ValueError: `memory` or `parameters` belongs to a different block, or its number of axes
            differs from the length of `position`. The quaternion of the goal is zero.
    """
    n = len(position)
    if parameters[0] != KIND:
        raise ValueError("cartesian_impedance: not the parameters of a CartesianImpedance")
    if len(parameters) != AXIS + GAINS * n:
        raise ValueError("cartesian_impedance: the block has another number of axes")
    work = forward(memory, position)
    wrench = work + SOLVER
    pose_error(memory, work, goal, wrench)
    columns = work + COLUMNS
    for k in range(6):
        rate = goal_velocity[k]
        for j in range(int(memory[JOINTS])):
            rate -= memory[columns + 6 * j + k] * velocity[int(memory[FIRST + JOINT * j])]
        spring = parameters[STIFFNESS + k] * memory[wrench + k]
        memory[wrench + k] = spring + parameters[DAMPING + k] * rate
    shorten(memory, wrench, parameters[LIMITS])
    shorten(memory, wrench + 3, parameters[LIMITS + 1])
    transmit(memory, work, wrench, torque)
    project(memory, work, parameters, velocity, torque)
    for i in range(n):
        torque[i] = limited(torque[i], parameters[AXIS + GAINS * i])


@compiles
def pose_error(memory: Row, work: int, goal: Row, at: int) -> None:
    """Write the error of the pose at `work` to six numbers at `at`: metres, then a rotation vector.

    Raise ValueError if the quaternion of the goal is zero.
    """
    for k in range(3):
        memory[at + k] = goal[k] - memory[work + 9 + k]
    quaternion(memory, work, memory, at + 3)
    # goal times the conjugate of the pose
    w, x, y, z = memory[at + 3], -memory[at + 4], -memory[at + 5], -memory[at + 6]
    a, b, c, d = goal[3], goal[4], goal[5], goal[6]
    real = a * w - b * x - c * y - d * z
    memory[at + 3] = a * x + b * w + c * z - d * y
    memory[at + 4] = a * y - b * z + c * w + d * x
    memory[at + 5] = a * z + b * y - c * x + d * w
    length = norm(memory, at + 3)
    if length == 0.0 and real == 0.0:
        raise ValueError("cartesian_impedance: the quaternion of the goal is zero")
    sign = -1.0 if real < 0.0 else 1.0  # the shorter of both rotations
    factor = 0.0 if length == 0.0 else 2.0 * sign * math.atan2(length, abs(real)) / length
    for k in range(3, 6):
        memory[at + k] *= factor


@compiles
def norm(memory: Row, at: int) -> float:
    """Return the length of the three numbers at `at`."""
    return math.sqrt(memory[at] ** 2 + memory[at + 1] ** 2 + memory[at + 2] ** 2)


@compiles
def shorten(memory: Row, at: int, limit: float) -> None:
    """Scale the vector of three numbers at `at` to at most the length `limit`."""
    length = norm(memory, at)
    if length > limit:
        for k in range(3):
            memory[at + k] *= limit / length


@compiles
def transmit(memory: Row, work: int, wrench: int, torque: Row) -> None:
    """Write Jᵀ times the six numbers at `wrench` to `torque`."""
    for i in range(len(torque)):
        torque[i] = 0.0
    for j in range(int(memory[JOINTS])):
        column = work + COLUMNS + 6 * j
        total = 0.0
        for k in range(6):
            total += memory[column + k] * memory[wrench + k]
        torque[int(memory[FIRST + JOINT * j])] = total

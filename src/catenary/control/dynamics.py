"""Gravity and inverse dynamics of an arm, computed by MuJoCo, for Python and for laws."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row, compiles
from catenary.control.model import Model, load_model
from catenary.control.parts import PerAxis
from catenary.control.pointers import call, doubles

KIND = 3.0
# layout of the memory: kind, then addresses and counts, then two indices for each axis
FUNCTION, MODEL, DATA, POSITION, VELOCITY, ACCELERATION, TORQUE = range(1, 8)
POSITIONS, VELOCITIES, AXES, PLACES = range(8, 12)

Vector = npt.NDArray[np.float64] | Sequence[float]


class Dynamics:
    """Rigid-body model of an arm, M(q) q̈ + C(q, q̇) q̇ + g(q) = τ, from an MJCF or URDF file.

    The model includes joint damping and armature (motor inertia reflected through the gear). It
    ignores contacts, joint limits and dry friction.

    Args:
        path: MJCF or URDF file.
        joints: names of the joints, in the order of the axes. None means all joints, in the
            order of the model. Joints that are not named stay at their initial positions.
        axes: required number of joints; None for any.
        armature: inertia to add to each joint [kg·m²], one value or one per axis.

    Raises:
        ConfigurationError: MuJoCo is not installed, the file is not a valid model, a joint is
            missing, given twice, or neither a hinge nor a slide, or their number is not `axes`.
        ValueError: `armature` is negative or NaN, or has a wrong number of values.

    Source: MuJoCo's `mj_inverse` (Featherstone's recursive Newton-Euler, computed in C).
    """

    def __init__(
        self,
        path: str | Path,
        *,
        joints: Sequence[str] | None = None,
        axes: int | None = None,
        armature: PerAxis = 0.0,
    ) -> None:
        # Another process (that of a task) reads the file again when it unpickles this object.
        self._rebuild = partial(Dynamics, path, joints=joints, axes=axes, armature=armature)
        self._model: Model = load_model(Path(path), joints, axes, armature)
        self._data = data = self._model.workspace()
        self._rows = (data.qpos, data.qvel, data.qacc, data.qfrc_inverse)  # each look-up is slow
        self._coordinates, self._degrees = np.array(self._model.places).T

    def __reduce__(self) -> tuple[partial[Dynamics], tuple[()]]:
        return self._rebuild, ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the axes."""
        return self._model.joints

    @property
    def memory(self) -> Row:
        """Row for the memory of a law: addresses of the model and of a new workspace.

        Each access creates another workspace. It exists until the process ends, since a law may
        outlive this object.
        """
        model = self._model
        data = model.workspace()
        for lasting in (model.native, data):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(lasting))
        fields = (data.qpos, data.qvel, data.qacc, data.qfrc_inverse)
        addresses = [model.function, model.native._address, data._address]
        addresses += [field.ctypes.data for field in fields]
        counts = [len(data.qpos), len(data.qvel), len(model.joints)]
        return np.array([KIND, *addresses, *counts, *np.ravel(model.places)], dtype=np.float64)

    def gravity(self, position: Vector) -> Row:
        """Return the torque (n,) [N·m] that holds the arm still at `position` (n,) [rad].

        Raises:
            ValueError: `position` does not have one number per joint.
        """
        return self._solve(self._checked("position", position), 0.0, 0.0)

    def inverse(self, position: Vector, velocity: Vector, acceleration: Vector) -> Row:
        """Compute the torques of a motion.

        Args:
            position: (n,) [rad].
            velocity: (n,) [rad/s].
            acceleration: (n,) [rad/s²].

        Returns:
            Torques (n,) [N·m].

        Raises:
            ValueError: An argument does not have one number per joint.
        """
        named = {"position": position, "velocity": velocity, "acceleration": acceleration}
        return self._solve(*(self._checked(name, values) for name, values in named.items()))

    def _solve(self, position: Row, velocity: Row | float, acceleration: Row | float) -> Row:
        coordinates, velocities, accelerations, forces = self._rows
        coordinates[self._coordinates] = position
        velocities[self._degrees] = velocity
        accelerations[self._degrees] = acceleration
        self._model.mujoco.mj_inverse(self._model.native, self._data)
        torque: Row = forces[self._degrees]
        return torque

    def _checked(self, name: str, values: Vector) -> Row:
        row = np.array(values, dtype=np.float64)
        if row.shape != (len(self.joints),):
            raise ValueError(
                f"{name} has shape {row.shape}; give one number for each of the "
                f"{len(self.joints)} joints ({', '.join(self.joints)})"
            )
        return row


@compiles
def inverse(memory: Row, position: Row, velocity: Row, acceleration: Row, torque: Row) -> None:
    """Compute the torques of a motion.

    Each call writes all inputs, so that no result depends on an earlier call.

    Args:
        memory: `Dynamics.memory`.
        position: (n,) [rad].
        velocity: (n,) [rad/s].
        acceleration: (n,) [rad/s²].
        torque: output, (n,) [N·m].

    Raises:
        ValueError: `memory` belongs to a different block, or its number of joints differs from the
            length of `position`.
    """
    check(memory, len(position))
    v = doubles(int(memory[VELOCITY]), int(memory[VELOCITIES]))
    a = doubles(int(memory[ACCELERATION]), int(memory[VELOCITIES]))
    for i in range(len(position)):
        degree = int(memory[PLACES + 2 * i + 1])
        v[degree] = velocity[i]
        a[degree] = acceleration[i]
    solve(memory, position, torque)


@compiles
def gravity(memory: Row, position: Row, torque: Row) -> None:
    """Compute the torques that hold the arm still.

    Args:
        memory: `Dynamics.memory`.
        position: (n,) [rad].
        torque: output, (n,) [N·m].

    Raises:
        ValueError: `memory` belongs to a different block, or its number of joints differs from the
            length of `position`.
    """
    check(memory, len(position))
    v = doubles(int(memory[VELOCITY]), int(memory[VELOCITIES]))
    a = doubles(int(memory[ACCELERATION]), int(memory[VELOCITIES]))
    for k in range(len(v)):
        v[k] = 0.0
        a[k] = 0.0
    solve(memory, position, torque)


@compiles
def check(memory: Row, n: int) -> None:
    """Raise ValueError unless `memory` belongs to a `Dynamics` with `n` joints."""
    if memory[0] != KIND:
        raise ValueError("not the memory of a Dynamics")
    if memory[AXES] != n:
        raise ValueError("the number of joints of the model differs from the number of axes")


@compiles
def solve(memory: Row, position: Row, torque: Row) -> None:
    """Call `mj_inverse` at `position`, and write its torques to `torque`.

    The caller has already written velocities and accelerations.
    """
    q = doubles(int(memory[POSITION]), int(memory[POSITIONS]))
    force = doubles(int(memory[TORQUE]), int(memory[VELOCITIES]))
    for i in range(len(position)):
        q[int(memory[PLACES + 2 * i])] = position[i]
    call(int(memory[FUNCTION]), int(memory[MODEL]), int(memory[DATA]))
    for i in range(len(position)):
        torque[i] = force[int(memory[PLACES + 2 * i + 1])]

"""Gravity and inverse dynamics of an arm, by MuJoCo: in Python, and called natively from a law."""

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
# of a law's memory: kind, then addresses and counts, then two places for each axis
FUNCTION, MODEL, DATA, POSITION, VELOCITY, ACCELERATION, TORQUE = range(1, 8)
POSITIONS, VELOCITIES, AXES, PLACES = range(8, 12)

Vector = npt.NDArray[np.float64] | Sequence[float]


class Dynamics:
    """Owns an arm's rigid-body model, M(q) q̈ + C(q, q̇) q̇ + g(q) = τ, read from an MJCF or URDF
    file.

    `joints`: the names of the axes' joints, in the axes' order; None: all joints of the model, in
    its order. Joints that are not named stay where the model has them. `axes`: how many there must
    be. The model's joint damping and armature (motor inertia seen through the gear) count, and
    `armature` [kg·m²] is added, one value or one for each axis; its contacts, joint limits and dry
    friction do not count. ConfigurationError: a file that is no model, a
    joint that it does not have, or one that is neither hinge nor slide.

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
        # for another process: it reads the file itself (a task's, before it starts)
        self._again = partial(Dynamics, path, joints=joints, axes=axes, armature=armature)
        self._model: Model = load_model(Path(path), joints, axes, armature)
        self._data = data = self._model.workspace()
        self._rows = (data.qpos, data.qvel, data.qacc, data.qfrc_inverse)  # looked up once
        self._coordinates, self._degrees = np.array(self._model.places).T

    def __reduce__(self) -> tuple[partial[Dynamics], tuple[()]]:
        return self._again, ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the axes' joints."""
        return self._model.joints

    @property
    def memory(self) -> Row:
        """A law's part of memory: where the model is, and a workspace of its own each time it is
        asked for, which stays as long as the process (a law may run longer than this object)."""
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
        """Return the torque (n,) [N·m] that holds the arm still at `position` (n,) [rad]."""
        return self._solve(self._checked("position", position), 0.0, 0.0)

    def inverse(self, position: Vector, velocity: Vector, acceleration: Vector) -> Row:
        """Return the torque (n,) [N·m] for a motion: (n,) [rad], [rad/s], [rad/s²]."""
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
                f"{name}: one number for each of {', '.join(self.joints)}, not {row.shape}"
            )
        return row


@compiles
def inverse(memory: Row, position: Row, velocity: Row, acceleration: Row, torque: Row) -> None:
    """torque (n,) [N·m] := what this motion takes: (n,) [rad], [rad/s], [rad/s²]. `memory`: of
    `Dynamics`. All inputs are written before the call: a trial step leaves nothing in the
    model."""
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
    """torque (n,) [N·m] := what holds the arm still at `position` (n,) [rad]. `memory`: of
    `Dynamics`."""
    check(memory, len(position))
    v = doubles(int(memory[VELOCITY]), int(memory[VELOCITIES]))
    a = doubles(int(memory[ACCELERATION]), int(memory[VELOCITIES]))
    for k in range(len(v)):
        v[k] = 0.0
        a[k] = 0.0
    solve(memory, position, torque)


@compiles
def check(memory: Row, n: int) -> None:
    if memory[0] != KIND:
        raise ValueError("this is not the memory of a Dynamics")
    if memory[AXES] != n:
        raise ValueError("the model has another number of joints than there are axes")


@compiles
def solve(memory: Row, position: Row, torque: Row) -> None:
    q = doubles(int(memory[POSITION]), int(memory[POSITIONS]))
    force = doubles(int(memory[TORQUE]), int(memory[VELOCITIES]))
    for i in range(len(position)):
        q[int(memory[PLACES + 2 * i])] = position[i]
    call(int(memory[FUNCTION]), int(memory[MODEL]), int(memory[DATA]))
    for i in range(len(position)):
        torque[i] = force[int(memory[PLACES + 2 * i + 1])]

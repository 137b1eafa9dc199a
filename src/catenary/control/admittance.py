"""Natural admittance control: an axis yields to a measured torque with the inertia it has."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, table
from catenary.control.pid import limited

KIND = 8.0
GAINS = 5  # inertia, damping, stiffness, velocity_gain, limit
STATES = 2  # begun, velocity of the model


@dataclass(frozen=True)
class NaturalAdmittance:
    """Each axis moves as its own `inertia` [kg·m²] on a spring (`stiffness` [N·m/rad]) and a damper
    (`damping` [N·m·s/rad]) would, without friction: a velocity loop of `velocity_gain`
    [N·m·s/rad] follows that model. `limit` of the torque [N·m].

    Since the inertia wanted is the one that is there, the axis stays passive towards any passive
    surrounding, however large `velocity_gain` is. Needs the external torque measured.

    Source: Newman, Stability and performance limits of interaction controllers, ASME J. Dyn. Sys.
    Meas. Control 114(4), 1992; Newman and Zhang, Stable interaction control and Coulomb friction
    compensation using natural admittance control, J. Robotic Systems 11(1), 1994.
    """

    axes: int
    inertia: PerAxis
    damping: PerAxis
    stiffness: PerAxis
    velocity_gain: PerAxis
    limit: PerAxis = math.inf

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 5 · axes,)."""
        n = axis_count(self.axes)
        names = ("damping", "stiffness", "velocity_gain")
        inertia = checked("inertia", self.inertia, n, above=True)
        others = [checked(name, getattr(self, name), n) for name in names]
        return table(KIND, inertia, *others, checked("limit", self.limit, n, above=True))

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (2 · axes,); the model begins at the axis' velocity."""
        return np.zeros(STATES * self.axes)


@compiles
def natural_admittance(
    memory: Row,
    parameters: Row,
    i: int,
    goal: float,
    goal_velocity: float,
    external: float,
    position: float,
    velocity: float,
    dt: float,
) -> float:
    """One step of axis `i`: the torque [N·m]. The model: m v' = K (goal - q) + B (goal' - v) +
    external; the torque: K (goal - q) + B (goal' - v) + G (v - measured)."""
    if parameters[0] != KIND:
        raise ValueError("natural_admittance: these are not a NaturalAdmittance's parameters")
    m, p = STATES * i, 1 + GAINS * i
    if memory[m] == 0.0:
        memory[m] = 1.0
        memory[m + 1] = velocity
    spring = parameters[p + 2] * (goal - position)
    damping = parameters[p + 1]
    drive = spring + damping * goal_velocity + external
    memory[m + 1] = (memory[m + 1] + drive * dt / parameters[p]) / (
        1 + damping * dt / parameters[p]
    )
    model = memory[m + 1]
    torque = spring + damping * (goal_velocity - model) + parameters[p + 3] * (model - velocity)
    return limited(torque, parameters[p + 4])

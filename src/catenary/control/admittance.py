"""Natural admittance control: an axis yields to a measured torque with its physical inertia."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table
from catenary.control.pid import limited

KIND = 8.0
GAINS = 5  # inertia, damping, stiffness, velocity_gain, limit
STATES = 2  # initialised, velocity of the model


@dataclass(frozen=True)
class NaturalAdmittance:
    """Settings of a natural admittance controller; each option is one value, or one per axis.

    The reference model is the inertia of the axis on a spring and a damper, without friction. A
    velocity loop makes the axis follow this model. The controller needs a measured external torque.

    The model has the physical inertia of the axis. The axis therefore stays passive in contact with
    any passive environment, for any `velocity_gain`.

    Args:
        axes: number of axes.
        inertia: inertia of the axis [kg·m²].
        damping: damping of the model [N·m·s/rad].
        stiffness: stiffness of the model [N·m/rad].
        velocity_gain: gain of the velocity loop [N·m·s/rad].
        limit: largest torque, in both directions [N·m].

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.

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
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 5 · axes,)."""
        n = axis_count(self.axes)
        names = ("damping", "stiffness", "velocity_gain")
        inertia = checked("inertia", self.inertia, n, above=True)
        others = [checked(name, getattr(self, name), n) for name in names]
        return table(KIND, inertia, *others, checked("limit", self.limit, n, above=True))

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (2 · axes,).

        The first step sets the velocity of the model to that of the axis.
        """
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
    """Compute one step of axis `i`.

    The model is m v' = K (goal - q) + B (goal' - v) + external. The torque is K (goal - q) +
    B (goal' - v) + G (v - velocity).

    Args:
        memory: `NaturalAdmittance.memory`.
        parameters: `NaturalAdmittance.parameters`.
        i: number of the axis.
        goal: target position [rad].
        goal_velocity: velocity of the target [rad/s].
        external: measured external torque [N·m].
        position: measured position q [rad].
        velocity: measured velocity [rad/s].
        dt: time since the previous step [s].

    Returns:
        Torque [N·m].

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("natural_admittance: not the parameters of a NaturalAdmittance")
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

"""Impedance control: spring and damper, with a disturbance observer for friction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, table
from catenary.control.pid import limited

KIND = 7.0
GAINS = 7  # stiffness, damping, inertia, friction, bandwidth, compensation, limit
STATES = 3  # begun, the filter's state, torque before


@dataclass(frozen=True)
class Impedance:
    """A spring and a damper towards the goal for each axis, friction taken away by an observer.

    `stiffness` [N·m/rad], `damping` [N·m·s/rad]; `limit` of the torque [N·m]. The nominal plant is
    1/(m s + b): `inertia` m [kg·m²], `friction` b [N·m·s/rad]. What acts on the axis beside the
    torque given and the external one is the disturbance, dry friction lumped into it, as seen
    through a low-pass of `bandwidth` [rad/s] (0: no observer); at most `compensation` [N·m] of it
    is taken away.

    Without a torque sensor the observer cannot tell friction from what the outside does: keep
    `compensation` at the dry friction's size, and beyond it the axis yields as the spring says.
    With a sensor give `external` to the step, and all of friction goes.

    Source: Ohnishi, Shibata and Murakami, Motion control for advanced mechatronics, IEEE/ASME
    Transactions on Mechatronics 1(1), 1996 (disturbance observer); Hogan, Impedance control, ASME
    J. Dyn. Sys. Meas. Control 107, 1985. As in RDDA (a two-axis gripper at 2 kHz).
    """

    axes: int
    stiffness: PerAxis
    damping: PerAxis
    inertia: PerAxis = 0.0
    friction: PerAxis = 0.0
    bandwidth: PerAxis = 0.0
    compensation: PerAxis = math.inf
    limit: PerAxis = math.inf

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    def parameters(self) -> Row:
        """(1 + 7 · axes,); the stiffness of axis i is number 1 + 7 i."""
        n = axis_count(self.axes)
        names = ("stiffness", "damping", "inertia", "friction", "bandwidth", "compensation")
        columns = [checked(name, getattr(self, name), n) for name in names]
        for i in np.flatnonzero((columns[4] > 0) & (columns[2] == 0)).tolist():
            raise ValueError(f"inertia of axis {i}: 0.0, the observer needs the nominal plant's")
        return table(KIND, *columns, checked("limit", self.limit, n, above=True))

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (3 · axes,); no disturbance."""
        return np.zeros(STATES * self.axes)


@compiles
def impedance(
    memory: Row,
    parameters: Row,
    i: int,
    goal: float,
    goal_velocity: float,
    feed_forward: float,
    external: float,
    position: float,
    velocity: float,
    dt: float,
) -> float:
    """One step of axis `i`: the torque [N·m]. `goal` [rad], `goal_velocity` [rad/s];
    `feed_forward` [N·m], a model's gravity, which the nominal plant knows nothing of; `external`
    [N·m], what a sensor says acts on the axis from outside (0: none)."""
    if parameters[0] != KIND:
        raise ValueError("impedance: these are not the parameters of an Impedance")
    p = 1 + GAINS * i
    spring = parameters[p] * (goal - position) + parameters[p + 1] * (goal_velocity - velocity)
    lost = disturbance(memory, STATES * i, parameters, p + 2, external, velocity, dt)
    taken = limited(lost, parameters[p + 5])
    torque = limited(spring + taken + feed_forward, parameters[p + 6])
    memory[STATES * i + 2] = torque - feed_forward
    return torque


@compiles
def disturbance(
    memory: Row, m: int, parameters: Row, p: int, external: float, velocity: float, dt: float
) -> float:
    """d = Q(s) (u + external - (m s + b) v), Q = w/(s + w), without differentiating:
    z = Q (u + external + (m w - b) v), d = z - m w v."""
    inertia, viscous, bandwidth = parameters[p], parameters[p + 1], parameters[p + 2]
    if bandwidth == 0.0:
        return 0.0
    share = 1.0 - math.exp(-bandwidth * dt)
    if memory[m] == 0.0:
        memory[m] = 1.0
        memory[m + 1] = inertia * bandwidth * velocity
    else:
        known = memory[m + 2] + external + (inertia * bandwidth - viscous) * velocity
        memory[m + 1] += share * (known - memory[m + 1])
    found: float = memory[m + 1] - inertia * bandwidth * velocity
    return found

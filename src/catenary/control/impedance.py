"""Impedance control: a spring and a damper, with a disturbance observer for friction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table
from catenary.control.pid import limited

KIND = 7.0
GAINS = 7  # stiffness, damping, inertia, friction, bandwidth, compensation, limit
STATES = 3  # initialised, state of the filter, previous torque without the feed-forward


@dataclass(frozen=True)
class Impedance:
    """Settings of an impedance controller; each option is one value, or one per axis.

    A spring and a damper pull each axis to its target. A disturbance observer compensates friction.
    The nominal plant is 1 / (m s + b). The disturbance is the torque on this plant other than the
    commanded and the measured external torque. It includes dry friction.

    Without a torque sensor, the observer cannot distinguish friction from a contact. Set
    `compensation` to the size of the dry friction. Larger torques then deflect the axis against the
    spring. With a sensor, pass `external` to the step. The observer then compensates all friction.

    Args:
        axes: number of axes.
        stiffness: stiffness of the spring [N·m/rad].
        damping: damping of the damper [N·m·s/rad].
        inertia: m of the nominal plant [kg·m²].
        friction: b of the nominal plant [N·m·s/rad].
        bandwidth: bandwidth of the observer [rad/s]; 0 disables the observer.
        compensation: largest torque that the observer compensates [N·m].
        limit: largest torque, in both directions [N·m].

    Raises:
        ValueError: A value is NaN or out of range, the number of values is wrong, or an axis with
            an observer has no inertia.

    Source: Ohnishi, Shibata and Murakami, Motion control for advanced mechatronics, IEEE/ASME
    Transactions on Mechatronics 1(1), 1996 (disturbance observer); Hogan, Impedance control, ASME
    J. Dyn. Sys. Meas. Control 107, 1985. RDDA (a two-axis gripper at 2 kHz) uses the same law.
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
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 7 · axes,); the stiffness of axis i is at 1 + 7 i."""
        n = axis_count(self.axes)
        names = ("stiffness", "damping", "inertia", "friction", "bandwidth", "compensation")
        columns = [checked(name, getattr(self, name), n) for name in names]
        for i in np.flatnonzero((columns[4] > 0) & (columns[2] == 0)).tolist():
            raise ValueError(
                f"inertia of axis {i} is 0; the observer (bandwidth > 0) needs the nominal inertia"
            )
        return table(KIND, *columns, checked("limit", self.limit, n, above=True))

    @property
    def memory(self) -> Row:
        """Initial memory: zeros (no disturbance), shape (3 · axes,)."""
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
    """Compute one step of axis `i`.

    Args:
        memory: `Impedance.memory`.
        parameters: `Impedance.parameters`.
        i: number of the axis.
        goal: target position [rad].
        goal_velocity: velocity of the target [rad/s].
        feed_forward: torque that the nominal plant does not contain, such as gravity [N·m].
        external: measured external torque [N·m]; 0 without a sensor.
        position: measured position [rad].
        velocity: measured velocity [rad/s].
        dt: time since the previous step [s].

    Returns:
        Torque [N·m].

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("impedance: not the parameters of an Impedance")
    p = 1 + GAINS * i
    spring = parameters[p] * (goal - position) + parameters[p + 1] * (goal_velocity - velocity)
    estimate = disturbance(memory, STATES * i, parameters, p + 2, external, velocity, dt)
    compensation = limited(estimate, parameters[p + 5])
    torque = limited(spring + compensation + feed_forward, parameters[p + 6])
    memory[STATES * i + 2] = torque - feed_forward
    return torque


@compiles
def disturbance(
    memory: Row, m: int, parameters: Row, p: int, external: float, velocity: float, dt: float
) -> float:
    """Return the disturbance d = Q(s) (u + external - (m s + b) v) with Q = w / (s + w).

    The equivalent form z = Q (u + external + (m w - b) v), d = z - m w v needs no derivative. The
    result is 0 in the first step, and for a bandwidth of 0.
    """
    inertia, viscous, bandwidth = parameters[p], parameters[p + 1], parameters[p + 2]
    if bandwidth == 0.0:
        return 0.0
    weight = 1.0 - math.exp(-bandwidth * dt)
    if memory[m] == 0.0:
        memory[m] = 1.0
        memory[m + 1] = inertia * bandwidth * velocity
    else:
        known = memory[m + 2] + external + (inertia * bandwidth - viscous) * velocity
        memory[m + 1] += weight * (known - memory[m + 1])
    estimate: float = memory[m + 1] - inertia * bandwidth * velocity
    return estimate

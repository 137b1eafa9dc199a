"""Collisions without a force sensor: the torque that the motion does not explain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.dynamics import inverse
from catenary.control.parts import PerAxis, axis_count, checked, table

RESIDUAL = 9.0
RESIDUAL_GAINS = 2  # gain, inertia
RESIDUAL_STATES = 3  # begun, residual, velocity before
THRESHOLD = 10.0
THRESHOLD_GAINS = 2  # limit, time


@dataclass(frozen=True)
class Residual:
    """The generalized-momentum observer: an estimate of the torque that acts on each axis from
    outside, first order with `gain` [1/s], from torque and velocity alone.

    `inertia` [kg·m²] of each axis for `residual`; a model has its own for `model_residual`.

    r = K (p - ∫ (τ + Cᵀ q̇ - g + r) dt), p = M q̇: De Luca and Mattone, Sensorless robot collision
    detection and hybrid force/motion control, ICRA 2005; Haddadin, De Luca and Albu-Schäffer, Robot
    collisions: a survey, IEEE T-RO 33(6), 2017, §IV. Here p and the integral of Ṁ q̇ are one sum,
    M(q_k) (q̇_k - q̇_k-1), which is the same by summation by parts and takes one call of the model.
    """

    axes: int
    gain: PerAxis
    inertia: PerAxis = 0.0

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    def parameters(self) -> Row:
        """(1 + 2 · axes,)"""
        n = axis_count(self.axes)
        gain = checked("gain", self.gain, n, above=True)
        return table(RESIDUAL, gain, checked("inertia", self.inertia, n))

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (3 · axes,)."""
        return np.zeros(RESIDUAL_STATES * self.axes)


@compiles
def residual(
    memory: Row, parameters: Row, i: int, torque: float, velocity: float, dt: float
) -> float:
    """One step of axis `i`: the external torque [N·m]. `torque` [N·m]: all that is known to act on
    the axis, the motor's less gravity and friction; `velocity` [rad/s]."""
    m = RESIDUAL_STATES * i
    moved = parameters[2 + RESIDUAL_GAINS * i] * (velocity - memory[m + 2])
    return observed(memory, m, parameters, i, moved - torque * dt, velocity, dt)


@compiles
def model_residual(
    memory: Row,
    parameters: Row,
    model: Row,
    torque: Row,
    position: Row,
    velocity: Row,
    dt: float,
    external: Row,
) -> None:
    """One step of all axes with a model, `model` the memory of a `Dynamics`: external (n,) := the
    torques from outside [N·m]. `torque` (n,) [N·m]: the motors', less the friction that the model
    does not have (it has its joints' `damping`); `position` (n,) [rad], `velocity` (n,) [rad/s]."""
    n = len(position)
    for i in range(n):
        external[i] = (velocity[i] - memory[RESIDUAL_STATES * i + 2]) / dt
    inverse(model, position, velocity, external, external)
    for i in range(n):
        impulse = (external[i] - torque[i]) * dt
        m = RESIDUAL_STATES * i
        external[i] = observed(memory, m, parameters, i, impulse, velocity[i], dt)


@compiles
def observed(
    memory: Row, m: int, parameters: Row, i: int, impulse: float, velocity: float, dt: float
) -> float:
    """r' = K (impulse / dt - r), implicitly, so that no gain is too large for the period."""
    if parameters[0] != RESIDUAL:
        raise ValueError("residual: these are not the parameters of a Residual")
    gain = parameters[1 + RESIDUAL_GAINS * i]
    if memory[m] == 0.0:
        memory[m] = 1.0  # the velocity before is not known yet
        memory[m + 1] = 0.0
    else:
        memory[m + 1] = (memory[m + 1] + gain * impulse) / (1.0 + gain * dt)
    memory[m + 2] = velocity
    found: float = memory[m + 1]
    return found


@dataclass(frozen=True)
class Threshold:
    """Something beyond `limit` for longer than `time` [s], for each axis: a residual, or the torque
    that a motor gives (its current) less the one expected, both [N·m]."""

    axes: int
    limit: PerAxis
    time: PerAxis = 0.0

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    def parameters(self) -> Row:
        """(1 + 2 · axes,)"""
        n = axis_count(self.axes)
        limit = checked("limit", self.limit, n, above=True)
        return table(THRESHOLD, limit, checked("time", self.time, n))

    @property
    def memory(self) -> Row:
        """Initial memory: time beyond the limit [s], shape (axes,)."""
        return np.zeros(self.axes)


@compiles
def threshold(memory: Row, parameters: Row, i: int, value: float, dt: float) -> bool:
    """Return True if `value` of axis `i` is beyond its limit, either way, for its time."""
    if parameters[0] != THRESHOLD:
        raise ValueError("threshold: these are not the parameters of a Threshold")
    p = 1 + THRESHOLD_GAINS * i
    if abs(value) <= parameters[p]:
        memory[i] = 0.0
        return False
    memory[i] += dt
    return bool(memory[i] > parameters[p + 1])

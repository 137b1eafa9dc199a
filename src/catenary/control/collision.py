"""Collision detection without a force sensor: the external torque is estimated from the motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.dynamics import inverse
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table

RESIDUAL = 9.0
RESIDUAL_GAINS = 2  # gain, inertia
RESIDUAL_STATES = 3  # initialised, residual, previous velocity
THRESHOLD = 10.0
THRESHOLD_GAINS = 2  # limit, time


@dataclass(frozen=True)
class Residual:
    """Settings of a generalized-momentum observer, which estimates the external torque.

    The estimate does not need a measured acceleration. It follows the external torque as a
    first-order low-pass.

    Args:
        axes: number of axes.
        gain: bandwidth of the observer [1/s].
        inertia: inertia of each axis [kg·m²], for `residual`. `model_residual` uses the inertia of
            its model instead.

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.

    Source: r = K (p - ∫ (τ + Cᵀ q̇ - g + r) dt) with p = M q̇. De Luca and Mattone, Sensorless robot
    collision detection and hybrid force/motion control, ICRA 2005; Haddadin, De Luca and
    Albu-Schäffer, Robot collisions: a survey, IEEE T-RO 33(6), 2017, §IV. This implementation
    replaces p and the integral of Ṁ q̇ by one sum, M(q_k) (q̇_k - q̇_k-1). Summation by parts shows
    that both are equal. The sum needs only one evaluation of the model.
    """

    axes: int
    gain: PerAxis
    inertia: PerAxis = 0.0

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 2 · axes,)."""
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
    """Compute one step of axis `i`.

    Args:
        memory: `Residual.memory`.
        parameters: `Residual.parameters`.
        i: number of the axis.
        torque: known torque on the axis [N·m]: motor torque minus gravity and friction.
        velocity: measured velocity [rad/s].
        dt: time since the previous step [s].

    Returns:
        Estimate of the external torque [N·m]; 0 in the first step.

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
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
    """Compute one step of all axes, with the inertia and gravity of a model.

    Args:
        memory: `Residual.memory`.
        parameters: `Residual.parameters`.
        model: `Dynamics.memory`.
        torque: motor torques (n,) [N·m], minus the friction that the model does not contain. The
            model contains the `damping` of its joints.
        position: measured positions (n,) [rad].
        velocity: measured velocities (n,) [rad/s].
        dt: time since the previous step [s].
        external: output, estimates of the external torques (n,) [N·m]; 0 in the first step.

    Raises:
        ValueError: `parameters` or `model` belongs to a different block, or the model has another
            number of joints.
    """
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
    """Integrate r' = K (impulse / dt - r) implicitly, which is stable for any gain and period.

    Return the estimate r, which is 0 in the first step. Raise ValueError if `parameters` belongs to
    a different block.
    """
    if parameters[0] != RESIDUAL:
        raise ValueError("residual: not the parameters of a Residual")
    gain = parameters[1 + RESIDUAL_GAINS * i]
    if memory[m] == 0.0:
        memory[m] = 1.0  # there is no previous velocity yet
        memory[m + 1] = 0.0
    else:
        memory[m + 1] = (memory[m + 1] + gain * impulse) / (1.0 + gain * dt)
    memory[m + 2] = velocity
    estimate: float = memory[m + 1]
    return estimate


@dataclass(frozen=True)
class Threshold:
    """Settings of a threshold with a minimum duration, for a residual or another quantity.

    Args:
        axes: number of axes.
        limit: largest accepted magnitude, in the unit of the value.
        time: accepted duration beyond the limit [s].

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.
    """

    axes: int
    limit: PerAxis
    time: PerAxis = 0.0

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 2 · axes,)."""
        n = axis_count(self.axes)
        limit = checked("limit", self.limit, n, above=True)
        return table(THRESHOLD, limit, checked("time", self.time, n))

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (axes,). It holds the time beyond the limit [s]."""
        return np.zeros(self.axes)


@compiles
def threshold(memory: Row, parameters: Row, i: int, value: float, dt: float) -> bool:
    """Compute one step of axis `i`.

    Args:
        memory: `Threshold.memory`.
        parameters: `Threshold.parameters`.
        i: number of the axis.
        value: quantity to compare; its sign does not matter.
        dt: time since the previous step [s].

    Returns:
        True if the value has exceeded its limit for longer than the accepted time.

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != THRESHOLD:
        raise ValueError("threshold: not the parameters of a Threshold")
    p = 1 + THRESHOLD_GAINS * i
    if abs(value) <= parameters[p]:
        memory[i] = 0.0
        return False
    memory[i] += dt
    return bool(memory[i] > parameters[p + 1])

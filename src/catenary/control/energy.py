"""Energy-based residual: one number that shows the power of external forces on an arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.dynamics import inverse
from catenary.control.parts import axis_count, checked, computed_once

KIND = 14.0
STATES = 2  # initialised, residual; then previous velocities and a work area


@dataclass(frozen=True)
class EnergyResidual:
    """Settings of an energy-based observer, which estimates the power of external forces [W].

    The estimate follows the power q̇ᵀ τ_ext as a first-order low-pass. It detects a collision, but
    does not show where it is: use `Residual` for the external torque of each axis.

    Limits: the estimate is 0 while the arm stands still, whatever pushes it. It is also 0 for a
    force that is perpendicular to the motion of its point of contact. It includes the power of all
    friction that the torque and the model do not contain.

    Args:
        axes: number of axes.
        gain: bandwidth of the observer [1/s].

    Raises:
        ValueError: A value is NaN or out of range.

    Source: r = K (E - ∫ (q̇ᵀ τ + r) dt - E(0)) with the energy E = q̇ᵀ M q̇ / 2 + U. Haddadin, De
    Luca and Albu-Schäffer, Robot collisions: a survey, IEEE T-RO 33(6), 2017; De Luca,
    Albu-Schäffer, Haddadin and Hirzinger, Collision detection and safe reaction with the DLR-III
    lightweight manipulator arm, IROS 2006. This implementation adds up the change of E in each
    step, q̇ᵀ (M q̈ + C q̇ + g) dt, with the mean velocity of the step. It needs one evaluation of
    the model, which includes joint damping.
    """

    axes: int
    gain: float

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (3,)."""
        gain = checked("gain", self.gain, 1, above=True)
        return np.concatenate([[KIND, axis_count(self.axes)], gain])

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (2 + 2 · axes,)."""
        return np.zeros(STATES + 2 * self.axes)


@compiles
def energy_residual(
    memory: Row,
    parameters: Row,
    model: Row,
    torque: Row,
    position: Row,
    velocity: Row,
    dt: float,
) -> float:
    """Compute one step.

    Args:
        memory: `EnergyResidual.memory`.
        parameters: `EnergyResidual.parameters`.
        model: `Dynamics.memory`.
        torque: motor torques since the previous step (n,) [N·m], minus the friction that the model
            does not contain. The model contains the `damping` of its joints.
        position: measured positions (n,) [rad].
        velocity: measured velocities (n,) [rad/s].
        dt: time since the previous step [s].

    Returns:
        Estimate of the power of external forces [W]; 0 in the first step. Positive if they
        accelerate the arm.

    Raises:
        ValueError: `parameters` or `model` belongs to a different block, or has another number of
            axes.
    """
    n = len(position)
    if parameters[0] != KIND:
        raise ValueError("energy_residual: not the parameters of an EnergyResidual")
    if parameters[1] != n:
        raise ValueError("energy_residual: the block has another number of axes")
    before, work = memory[STATES : STATES + n], memory[STATES + n : STATES + 2 * n]
    for i in range(n):
        work[i] = (velocity[i] - before[i]) / dt
    inverse(model, position, velocity, work, work)
    power = 0.0
    for i in range(n):
        power += 0.5 * (velocity[i] + before[i]) * (work[i] - torque[i])
        before[i] = velocity[i]
    if memory[0] == 0.0:
        memory[0] = 1.0  # there is no previous velocity yet
        return 0.0
    memory[1] = (memory[1] + parameters[2] * power * dt) / (1.0 + parameters[2] * dt)
    estimate: float = memory[1]
    return estimate

"""Time-domain passivity: an observer of the energy at a port, and a controller that dissipates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.coupling import REACTION
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table

KIND = 23.0
GAINS = 3  # tolerance, largest damping, latency
STATES = 8
STARTED, POSITION, TORQUE, BEFORE, ENERGY_IN, ENERGY_OUT, OBSERVED, LEAST = range(STATES)


@dataclass(frozen=True)
class Passivity:
    """Settings of a passivity observer and controller at the port of a coupling and its device.

    The port is where the coupling moves the device. The drive holds a torque during a cycle, so
    -τ_k (q_k+1 - q_k) is the exact energy that the coupling takes from the device in this cycle.
    The observer sums positive and negative values separately: energy in, and energy out. Both only
    increase, so the energies of the other side remain valid bounds when they arrive late.

    The observed energy is the sum over both ports, with the initial one as 0. Let the message of
    the other side leave it at time s, and let r < s be the time of the newest own message that it
    had received. Then in(t) - out(r) + in_other(s) - out_other(s) is at least the energy of the
    whole coupling at time s. This needs no synchronised clocks. An observed energy below the
    tolerance therefore proves an active coupling. The opposite is not proved: the observer reports
    a violation by at most a round trip late.

    A passive coupling may show energies down to -ε, with ε = K (2 δ v + p)² / 2. Its spring stores
    K e² / 2. The torque of a cycle belongs to a deflection e that is δ old, two periods. In this
    time, each end moves by at most δ v, and each position is rounded by p / 2. So the sum is the
    stored energy of an e that is wrong by up to 2 δ v + p. The energy lost per cycle by the late
    spring, K δ q̇², is covered by the damper: it is part of the condition of `Coupling`.

    Alignment is not passive. While `Coupling` closes a distance d, at the start or after a loss of
    the link, it winds the spring. This supplies at most K d times the largest deflection, and the
    observed energy can stay below -ε by this amount. Begin with equal positions to avoid it.

    The controller adds a damper when the observed energy falls below -ε. It chooses the damper that
    dissipates the deficit in one cycle, limited to `damping`. This damper acts δ late, too: the sum
    of both dampers times δ must not exceed the inertia of the device.

    Source: Ryu, Kwon and Hannaford, Stable teleoperation with time-domain passivity control, IEEE
    T-RA 20(2), 2004; Ryu, Artigas and Preusche, A passive bilateral control scheme for a
    teleoperator with time-varying communication delay, Mechatronics 20, 2010. They compare the
    energy out of one port with the energy into the other. The spring of a P+d coupling returns
    energy to the port that loaded it, which their test reports as active. The sum does not.

    If both sides have different stiffnesses or a `scale`, multiply the energies of the other side
    by K_own scale² / K_other. The sum is then the energy that the condition bounds.

    Args:
        axes: number of axes.
        stiffness: stiffness K of the coupling [N·m/rad], in the coordinates of this device.
        velocity: largest velocity of both devices [rad/s].
        period: period of the loop [s].
        quantum: resolution p of the position [rad]: 2 π / counts_per_turn of the joint.
        damping: largest damping that the controller adds [N·m·s/rad]; 0 for an observer only.
        latency: cycles from the step to the torque at the device: 1 for a law or a loop, 0 if the
            torque acts at once.

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.
    """

    axes: int
    stiffness: PerAxis
    velocity: PerAxis
    period: float
    quantum: PerAxis = 0.0
    damping: PerAxis = 0.0
    latency: int = 1

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    def tolerance(self) -> Row:
        """ε of each axis, shape (axes,) [J]."""
        n = axis_count(self.axes)
        if not 0 < self.period < math.inf:
            raise ValueError(f"period={self.period} s must be positive and finite")
        moved = 2 * REACTION * self.period * checked("velocity", self.velocity, n)
        wrong = moved + checked("quantum", self.quantum, n)
        return checked("stiffness", self.stiffness, n) * wrong**2 / 2

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 3 · axes,)."""
        if self.latency not in (0, 1):
            raise ValueError(f"latency={self.latency} must be 0 or 1")
        damping = checked("damping", self.damping, axis_count(self.axes))
        latency = np.full(self.axes, float(self.latency))
        return table(KIND, self.tolerance, damping, latency)

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (8 · axes,). See `energies`."""
        return np.zeros(STATES * self.axes)


@dataclass(frozen=True, slots=True)
class Energies:
    """Energies of each axis, each with shape (axes,) [J]; see `energies`."""

    taken: Row  # from the device into the coupling; only increases
    returned: Row  # from the coupling to the device; only increases
    observed: Row  # of the whole coupling, at the last step
    least: Row  # smallest observed energy


def energies(memory: Row) -> Energies:
    """Return copies of the energies in the memory of a `Passivity`."""
    rows = np.array(memory, dtype=np.float64).reshape(-1, STATES)
    return Energies(*(rows[:, k].copy() for k in (ENERGY_IN, ENERGY_OUT, OBSERVED, LEAST)))


@compiles
def passivity(
    memory: Row,
    parameters: Row,
    i: int,
    torque: float,
    remote: float,
    position: float,
    velocity: float,
    dt: float,
) -> float:
    """Compute one step of axis `i`.

    Args:
        memory: `Passivity.memory`.
        parameters: `Passivity.parameters`.
        i: number of the axis.
        torque: torque of the coupling on the device [N·m], without gravity compensation.
        remote: in_other(s) - out_other(s) - out(r) [J]: the energies of the newest message of the
            other side, and the energy that this port had returned in the newest message that the
            other side had received. Without an other side, minus the energy returned by this port.
            A value that is not finite leaves the observed energy unchanged, and adds no damper.
        position: measured position [rad].
        velocity: measured velocity [rad/s].
        dt: time since the previous step [s].

    Returns:
        Torque with the damper of the controller [N·m].

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("passivity: not the parameters of a Passivity")
    m, p = STATES * i, 1 + GAINS * i
    if memory[m + STARTED] == 0.0:
        memory[m + STARTED], memory[m + POSITION] = 1.0, position
    applied = memory[m + BEFORE] if parameters[p + 2] == 1.0 else memory[m + TORQUE]
    flow = -applied * (position - memory[m + POSITION])
    memory[m + ENERGY_IN] += max(flow, 0.0)
    memory[m + ENERGY_OUT] += max(-flow, 0.0)
    damper = 0.0
    if math.isfinite(remote):
        observed = memory[m + ENERGY_IN] + remote
        memory[m + OBSERVED] = observed
        memory[m + LEAST] = min(memory[m + LEAST], observed)
        damper = damper_of(-parameters[p] - observed, parameters[p + 1], velocity, dt)
    total: float = torque - damper * velocity
    memory[m + POSITION] = position
    memory[m + BEFORE] = memory[m + TORQUE]
    memory[m + TORQUE] = total
    return total


@compiles
def damper_of(deficit: float, largest: float, velocity: float, dt: float) -> float:
    """Return the damping that dissipates `deficit` in `dt`; at most `largest`."""
    power = velocity * velocity * dt
    if deficit <= 0.0 or power == 0.0:
        return 0.0
    return min(deficit / power, largest)

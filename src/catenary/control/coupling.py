"""P+d coupling of two devices over a link with varying delay, and its stability condition."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table
from catenary.control.pid import limited

KIND = 21.0
GAINS = 6  # stiffness, damping, scale, deflection, stiffness of holding, alignment
STATES = 3  # state, position at which the axis holds, offset of the reference
START, HOLDING, COUPLED = 0.0, 1.0, 2.0
REACTION = 2.0  # periods from a measurement to the end of the torque that results from it


@dataclass(frozen=True)
class Coupling:
    """Settings of one side of a P+d coupling; each option is one value, or one per axis.

    A spring pulls each axis to the position that the other side has sent, and a damper brakes it:

        τ = K (q_other(t - T) - q) - B q̇

    Both sides exchange positions only. There is no force sensor: the spring deflects in contact,
    and the operator feels its torque. Equal positions are the only equilibrium without contact, so
    the devices do not drift apart. The motion stays bounded for a passive operator and a passive
    environment if, for each axis,

        4 (B_l - K_l δ) (B_r - K_r δ) > (T_l + T_r + 2 δ)² K_l K_r

    T_l and T_r are the largest ages of the two received positions. They may vary at any rate, so
    lost and reordered packets only make them larger. δ is the reaction of a loop, two periods.

    Derivation: V = E_l / K_l + E_r / K_r + (q_l - q_r)² / 2, with the kinetic energies E. With
    q(t - T) - q = -∫ q̇ over the last T seconds, the integral of dV/dt contains
    -B_l / K_l q̇_l² - B_r / K_r q̇_r² and two products of a velocity and such an integral.
    Young's inequality and Schwarz's bound the products by a/2 x² + T² / (2 a) y². Numbers a
    exist for which all terms are negative exactly if the condition holds. The own position is δ
    old, too, which subtracts δ from B / K.

    Source: Nuño, Basañez and Ortega, Passivity-based control for bilateral teleoperation: a
    tutorial, Automatica 47, 2011 (P+d controller, for δ = 0). Gravity is not part of it: add it to
    the result.

    Different stiffnesses scale the torque: in contact, the leader feels K_l scale / K_r of the
    follower's torque, with the scale of the leader. `scale` multiplies the received position. It is
    a change of coordinates, which changes neither B / K nor the condition.

    Args:
        axes: number of axes.
        stiffness: K of this side [N·m/rad].
        damping: B of this side [N·m·s/rad].
        delay: bound of T_l + T_r [s]: `max_delay` of a `teleoperation.Peer`, plus the time that a
            position waits in the programs of both sides.
        period: longer period of the two loops [s].
        peer: stiffness and damping of the other side; None if they are those of this side.
        scale: this side's motion divided by the other side's. The other side uses the reciprocal.
        deflection: largest effective deflection of the spring [rad], in this side's coordinates. It
            limits the torque of the spring to K · deflection, with and without a link. A saturated
            spring is not stiffer, so the condition holds if both sides have the same limit.
        hold: stiffness with which an axis holds without a link [N·m/rad]; None for `stiffness`. It
            must be below B / δ, since this spring acts δ late, too.
        align: speed at which an initial distance between both sides is closed [rad/s]. This winds
            the spring, and can therefore supply energy: see `Passivity`.
        inertia: smallest inertia of an axis of this device [kg·m²]; 0 skips its check. The damper
            acts δ late, so B δ must not exceed the inertia.

    Raises:
        ValueError: A value is NaN or out of range, the number of values is wrong, or the gains do
            not satisfy the condition. The message names gains that do.
    """

    axes: int
    stiffness: PerAxis
    damping: PerAxis
    delay: float
    period: float
    peer: tuple[PerAxis, PerAxis] | None = None
    scale: PerAxis = 1.0
    deflection: PerAxis = math.inf
    hold: PerAxis | None = None
    align: PerAxis = 0.5
    inertia: PerAxis = 0.0

    def __post_init__(self) -> None:
        _ = self.parameters
        for name in ("delay", "period"):
            value = getattr(self, name)
            if not 0 <= value < math.inf or (name == "period" and value == 0):
                raise ValueError(f"{name}={value} s must be finite and not negative")
        self._check_inertia()
        self._check_hold()
        self._check_delay()

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 6 · axes,)."""
        n = axis_count(self.axes)
        names = ("stiffness", "damping", "scale", "deflection")
        columns = [checked(name, getattr(self, name), n, above=True) for name in names]
        held = self.stiffness if self.hold is None else self.hold
        columns += [checked("hold", held, n), checked("align", self.align, n, above=True)]
        return table(KIND, *columns)

    @property
    def memory(self) -> Row:
        """Initial memory: zeros, shape (3 · axes,). Without a link, the first step holds."""
        return np.zeros(STATES * self.axes)

    @property
    def longest_delay(self) -> Row:
        """Bounds of T_l + T_r for which the condition holds, shape (axes,) [s]; -1 for none."""
        own, other = self._ratios()
        room = np.maximum(own - self._reaction, 0) * np.maximum(other - self._reaction, 0)
        longest = 2 * np.sqrt(room) - 2 * self._reaction
        return np.where(longest > 0, longest, -1.0)

    @property
    def _reaction(self) -> float:
        return REACTION * self.period

    def _ratios(self) -> tuple[Row, Row]:
        """Return B / K of this side and of the other side, each (axes,) [s]."""
        n = self.axes
        stiffness, damping = (self.stiffness, self.damping) if self.peer is None else self.peer
        peer_damping = checked("peer damping", damping, n, above=True)
        other = peer_damping / checked("peer stiffness", stiffness, n, above=True)
        return checked("damping", self.damping, n) / checked("stiffness", self.stiffness, n), other

    def _check_inertia(self) -> None:
        inertia = checked("inertia", self.inertia, self.axes)
        damping = checked("damping", self.damping, self.axes)
        late = (inertia > 0) & (damping * self._reaction > inertia)
        for i in np.flatnonzero(late).tolist():
            raise ValueError(
                f"coupling of axis {i}: a damping of {damping[i]:g} N·m·s/rad that acts "
                f"{1e3 * self._reaction:g} ms late makes an inertia of {inertia[i]:g} kg·m² "
                f"oscillate; use at most {inertia[i] / self._reaction:.3g} N·m·s/rad or a shorter "
                "period"
            )

    def _check_hold(self) -> None:
        if self.hold is None:
            return  # the condition contains B > K δ
        hold = checked("hold", self.hold, self.axes)
        stable = checked("damping", self.damping, self.axes) / self._reaction
        for i in np.flatnonzero(hold >= stable).tolist():
            raise ValueError(
                f"hold of axis {i} is {hold[i]:g} N·m/rad; with this damping and a reaction of "
                f"{1e3 * self._reaction:g} ms, it must be below {stable[i]:.3g} N·m/rad"
            )

    def _check_delay(self) -> None:
        longest = self.longest_delay
        for i in np.flatnonzero(~(longest > self.delay)).tolist():
            raise ValueError(self._refusal(i, longest[i]))

    def _refusal(self, i: int, longest: float) -> str:
        """Return the message for an axis with gains that do not satisfy the condition."""
        own, other = self._ratios()
        needed = 1.01 * (self.delay / 2 + 2 * self._reaction)  # equal B / K on both sides
        damping = checked("damping", self.damping, self.axes)[i]
        stiffness = checked("stiffness", self.stiffness, self.axes)[i]
        permitted = f"{1e3 * longest:.3g} ms" if longest > 0 else "no delay at all"
        advice = (
            f"raise the damping to {stiffness * needed:.3g} N·m·s/rad, or lower the stiffness to "
            f"{damping / needed:.3g} N·m/rad"
            if own[i] < needed
            else "at the other side, raise the damping or lower the stiffness"
        )
        return (
            f"coupling of axis {i}: stiffness {stiffness:g} N·m/rad and damping {damping:g} "
            f"N·m·s/rad (B/K is {1e3 * own[i]:.3g} ms here, {1e3 * other[i]:.3g} ms at the other "
            f"side) permit {permitted} in both directions together, not {1e3 * self.delay:g} ms; "
            f"B/K of {1e3 * needed:.3g} ms on both sides is enough: {advice}"
        )


@compiles
def coupling(
    memory: Row,
    parameters: Row,
    i: int,
    peer: float,
    connected: float,
    position: float,
    velocity: float,
    dt: float,
) -> float:
    """Compute one step of axis `i`.

    Without a link, the axis holds its position at the loss, with the stiffness `hold` and the same
    damping. When the link returns, the spring keeps the torque with which it has held, so the
    torque has no step. The reference then approaches the received position with the speed `align`.

    Args:
        memory: `Coupling.memory`.
        parameters: `Coupling.parameters`.
        i: number of the axis.
        peer: newest position of the other side [rad]. A value that is not finite counts as a lost
            link.
        connected: 1 with a link, 0 without.
        position: measured position [rad].
        velocity: measured velocity [rad/s].
        dt: time since the previous step [s].

    Returns:
        Torque [N·m].

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("coupling: not the parameters of a Coupling")
    p, m = 1 + GAINS * i, STATES * i
    reach = parameters[p + 3]
    held = 0.0
    if memory[m] == HOLDING:
        held = limited(parameters[p + 4] * (memory[m + 1] - position), parameters[p] * reach)
    if connected == 0.0 or not math.isfinite(peer):
        if memory[m] != HOLDING:
            memory[m], memory[m + 1] = HOLDING, position
        spring = held
    else:
        wanted = parameters[p + 2] * peer
        aligned(memory, m, wanted, parameters[p + 5] * dt, position + held / parameters[p])
        spring = parameters[p] * limited(wanted + memory[m + 2] - position, reach)
    torque: float = spring - parameters[p + 1] * velocity
    return torque


@compiles
def aligned(memory: Row, m: int, wanted: float, step: float, start: float) -> None:
    """Reduce the offset of the reference by at most `step`. The reference begins at `start`."""
    if memory[m] != COUPLED:
        memory[m], memory[m + 2] = COUPLED, start - wanted
    memory[m + 2] -= limited(memory[m + 2], step)

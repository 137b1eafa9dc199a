"""Proportional force feedback from a follower to its leader, and its passivity limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from catenary.control.compiles import Row, compiles
from catenary.control.coupling import REACTION
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table
from catenary.control.pid import limited

KIND = 22.0
GAINS = 3  # gain, damping, limit


@dataclass(frozen=True)
class ForceFeedback:
    """Settings of proportional force feedback at a leader; each option is one value, or per axis.

    The follower couples its position to the leader's with a spring K and a damper B_r, and sends
    the torque of its spring. The leader applies -gain times this torque and a damper B_l. Unlike
    P+d, the leader feels no spring of its own, but its own position returns after a round trip D.
    A round trip D makes the reflected stiffness active, so a gain above the limit is refused:

        gain < B_l / (K (D + D² / (4 (B_r / K - δ)))),   D = delay + 2 δ

    Derivation: as for `Coupling`, with V = E_l / gain + E_r + K (q_l - q_r)² / 2. The leader's
    term has the ages D and T_r + δ, the follower's T_l + δ and δ. δ is two periods. For a small
    delay, this is B_l > gain K D: the damper absorbs the energy of a spring that acts D late.

    RDDA's teleoperation (github.com/RoboticsCollaborative/RDDA, src/toolbox) couples by wave
    variables instead, with a factor of 1.2 at its leader, and does not publish a limit.

    Args:
        axes: number of axes.
        gain: reflected part of the follower's torque.
        damping: B_l [N·m·s/rad].
        follower: stiffness K [N·m/rad] and damping B_r [N·m·s/rad] of the follower's coupling.
        delay: bound of the sum of both delays [s], as in `Coupling`.
        period: longer period of the two loops [s].
        limit: largest reflected torque [N·m].

    Raises:
        ValueError: A value is NaN or out of range, the number of values is wrong, or the gain
            reaches its limit.
    """

    axes: int
    gain: PerAxis
    damping: PerAxis
    follower: tuple[PerAxis, PerAxis]
    delay: float
    period: float
    limit: PerAxis = math.inf

    def __post_init__(self) -> None:
        if not (0 <= self.delay < math.inf and 0 < self.period < math.inf):
            raise ValueError(
                f"delay={self.delay} s and period={self.period} s must be finite; the period must "
                "be positive"
            )
        gain, largest = checked("gain", self.gain, axis_count(self.axes)), self.largest_gain
        for i in np.flatnonzero(~(gain < largest)).tolist():
            raise ValueError(
                f"force feedback of axis {i}: a gain of {gain[i]:g} is not passive with a delay of "
                f"{1e3 * self.delay:g} ms; it must be below {largest[i]:.3g}. A larger damping of "
                "the leader or a softer follower raises this limit"
            )

    @property
    def largest_gain(self) -> Row:
        """Passivity limits of the gain, shape (axes,); 0 if the follower alone is not stable."""
        reaction, n = REACTION * self.period, self.axes
        stiffness = checked("stiffness of the follower", self.follower[0], n, above=True)
        ratio = checked("damping of the follower", self.follower[1], n) / stiffness - reaction
        trip = self.delay + 2 * reaction
        with np.errstate(divide="ignore"):
            late = trip + trip**2 / (4 * np.maximum(ratio, 0.0))
        return checked("damping", self.damping, n, above=True) / (stiffness * late)

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 3 · axes,)."""
        n = self.axes
        limit = checked("limit", self.limit, n, above=True)
        gain, damping = checked("gain", self.gain, n), checked("damping", self.damping, n)
        return table(KIND, gain, damping, limit)


@compiles
def force_feedback(parameters: Row, i: int, torque: float, velocity: float) -> float:
    """Return the torque of the leader's axis `i` [N·m].

    Args:
        parameters: `ForceFeedback.parameters`.
        i: number of the axis.
        torque: newest received torque of the follower's spring [N·m]. A value that is not finite
            counts as 0. Pass 0 without a link, or an old torque keeps pushing the leader.
        velocity: measured velocity of the leader [rad/s].

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("force_feedback: not the parameters of a ForceFeedback")
    p = 1 + GAINS * i
    felt = torque if math.isfinite(torque) else 0.0
    reflected: float = limited(-parameters[p] * felt, parameters[p + 2])
    return reflected - float(parameters[p + 1]) * velocity

"""Feed-forward torques: of a motion, and of friction."""

from __future__ import annotations

import math
from dataclasses import dataclass

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, table

FEED_FORWARD = 5.0
FRICTION = 6.0


@dataclass(frozen=True)
class FeedForward:
    """Feed-forward torque of a motion: `inertia` [kg·m²], `damping` [N·m·s/rad]. Has no memory."""

    axes: int
    inertia: PerAxis
    damping: PerAxis = 0.0

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 2 · axes,)."""
        n = axis_count(self.axes)
        return table(
            FEED_FORWARD, checked("inertia", self.inertia, n), checked("damping", self.damping, n)
        )


@compiles
def feed_forward(parameters: Row, i: int, velocity: float, acceleration: float) -> float:
    """Return the torque [N·m] of axis `i` for a motion [rad/s], [rad/s²]: J q̈ + b q̇."""
    if parameters[0] != FEED_FORWARD:
        raise ValueError("feed_forward: these are not the parameters of a FeedForward")
    torque: float = parameters[1 + 2 * i] * acceleration + parameters[2 + 2 * i] * velocity
    return torque


@dataclass(frozen=True)
class Friction:
    """The friction of each axis: `viscous` [N·m·s/rad], `coulomb` [N·m], which turns its sign
    within about ± `transition` [rad/s]. Has no memory.

    Source: Armstrong-Hélouvry, Dupont and Canudas de Wit, A survey of models, analysis tools and
    compensation methods for the control of machines with friction, Automatica 30(7), 1994; the sign
    smoothed by tanh.
    """

    axes: int
    viscous: PerAxis
    coulomb: PerAxis
    transition: PerAxis = 0.05

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 3 · axes,)."""
        n = axis_count(self.axes)
        both = [checked(name, getattr(self, name), n) for name in ("viscous", "coulomb")]
        return table(FRICTION, *both, checked("transition", self.transition, n, above=True))


@compiles
def friction(parameters: Row, i: int, velocity: float) -> float:
    """Return the torque [N·m] that axis `i` loses at a velocity: b q̇ + T_c tanh(q̇ / v_t).

    Args:
        parameters: of a `Friction`.
        i: number of the axis.
        velocity: wanted velocity [rad/s]. Compensating the measured one makes an axis at rest
            tremble.
    """
    if parameters[0] != FRICTION:
        raise ValueError("friction: these are not the parameters of a Friction")
    p = 1 + 3 * i
    dry = parameters[p + 1] * math.tanh(velocity / parameters[p + 2])
    torque: float = parameters[p] * velocity + dry
    return torque

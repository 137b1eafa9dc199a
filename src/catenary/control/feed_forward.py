"""Feed-forward torques for inertia, damping and friction."""

from __future__ import annotations

import math
from dataclasses import dataclass

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table

FEED_FORWARD = 5.0
FRICTION = 6.0


@dataclass(frozen=True)
class FeedForward:
    """Settings of a feed-forward torque. The block has no memory.

    Args:
        axes: number of axes.
        inertia: inertia of each axis [kg·m²].
        damping: damping of each axis [N·m·s/rad].

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.
    """

    axes: int
    inertia: PerAxis
    damping: PerAxis = 0.0

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 2 · axes,)."""
        n = axis_count(self.axes)
        return table(
            FEED_FORWARD, checked("inertia", self.inertia, n), checked("damping", self.damping, n)
        )


@compiles
def feed_forward(parameters: Row, i: int, velocity: float, acceleration: float) -> float:
    """Return the torque of axis `i` for a motion, J q̈ + b q̇ [N·m].

    Args:
        parameters: `FeedForward.parameters`.
        i: number of the axis.
        velocity: target velocity [rad/s].
        acceleration: target acceleration [rad/s²].

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != FEED_FORWARD:
        raise ValueError("feed_forward: not the parameters of a FeedForward")
    torque: float = parameters[1 + 2 * i] * acceleration + parameters[2 + 2 * i] * velocity
    return torque


@dataclass(frozen=True)
class Friction:
    """Settings of a friction model. The block has no memory.

    Args:
        axes: number of axes.
        viscous: viscous friction [N·m·s/rad].
        coulomb: dry friction [N·m].
        transition: velocity range in which the dry friction changes its sign, about
            ± `transition` [rad/s].

    Raises:
        ValueError: A value is NaN or out of range, or the number of values is wrong.

    Source: Armstrong-Hélouvry, Dupont and Canudas de Wit, A survey of models, analysis tools and
    compensation methods for the control of machines with friction, Automatica 30(7), 1994; tanh
    smooths the sign function.
    """

    axes: int
    viscous: PerAxis
    coulomb: PerAxis
    transition: PerAxis = 0.05

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 3 · axes,)."""
        n = axis_count(self.axes)
        both = [checked(name, getattr(self, name), n) for name in ("viscous", "coulomb")]
        return table(FRICTION, *both, checked("transition", self.transition, n, above=True))


@compiles
def friction(parameters: Row, i: int, velocity: float) -> float:
    """Return the friction torque of axis `i` at a velocity, b q̇ + T_c tanh(q̇ / v_t) [N·m].

    Args:
        parameters: `Friction.parameters`.
        i: number of the axis.
        velocity: target velocity [rad/s]. With the measured velocity, an axis at rest would
            oscillate.

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != FRICTION:
        raise ValueError("friction: not the parameters of a Friction")
    p = 1 + 3 * i
    dry = parameters[p + 1] * math.tanh(velocity / parameters[p + 2])
    torque: float = parameters[p] * velocity + dry
    return torque

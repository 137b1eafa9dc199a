"""Conversion of a drive's raw numbers to SI units at the joint, after the gear, and back.

A rotary axis has rad, rad/s and N·m. A linear axis (`metres_per_turn`) has m, m/s and N.

CiA 402-2 §8 (factor group) leaves the units to the drive. Most drives use the following units,
which are the defaults: position in encoder counts, velocity in counts per second, torque in
thousandths of the rated torque 0x6076 (mN·m).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

from catenary.drive.objects import Unit
from catenary.plan.cycle import Number

V = TypeVar("V")


class UnitNames(NamedTuple):
    """Names of an axis' units, for reports and messages."""

    position: str
    velocity: str
    acceleration: str
    torque: str
    torque_limit: str = "torque_limit"  # the option of `Drives`

    @property
    def torque_slope(self) -> str:
        return f"{self.torque}/s"


ROTARY = UnitNames("rad", "rad/s", "rad/s²", "N·m")
LINEAR = UnitNames("m", "m/s", "m/s²", "N", "force_limit")


class AxisDefaults(NamedTuple):
    """Defaults of an axis, in its units."""

    velocity_limit: float  # in CSP and PP
    step_limit: float  # least one
    standstill: float  # velocity
    deceleration: float  # of an axis without a velocity limit and without a cyclic mode


ROTARY_DEFAULTS = AxisDefaults(2 * math.pi, 0.1, 0.05, 25.0)
LINEAR_DEFAULTS = AxisDefaults(0.1, 0.005, 0.005, 0.4)


@dataclass(frozen=True, slots=True)
class AxisUnits:
    """Scales of an axis: one raw count in units of the joint.

    `counts_per_turn`: of the motor's encoder. `gear_ratio`: motor turns per joint turn.
    `direction`: +1, or -1 if the joint turns against the motor. `offset` [rad]: position of the
    joint at the drive's 0. `velocity_unit` [rad/s of the motor]: one raw count; None: one position
    count per second. `rated_torque` [N·m at the motor]: None until read from 0x6076.
    `metres_per_turn`: travel per turn of the gear's output side; None: a rotary axis. For a linear
    axis, the offset is in m.
    """

    counts_per_turn: float
    gear_ratio: float = 1.0
    direction: int = 1
    offset: float = 0.0
    velocity_unit: float | None = None
    rated_torque: float | None = None
    metres_per_turn: float | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.counts_per_turn) and self.counts_per_turn > 0):
            raise ValueError(f"counts_per_turn must be positive, not {self.counts_per_turn}")
        if not (math.isfinite(self.gear_ratio) and self.gear_ratio > 0):
            raise ValueError(
                f"gear_ratio must be positive, not {self.gear_ratio}; use direction=-1"
            )
        if self.direction not in (1, -1):
            raise ValueError(f"direction must be 1 or -1, not {self.direction}")
        if not math.isfinite(self.offset):
            raise ValueError(f"offset must be finite [{self.names.position}], not {self.offset}")
        for name in ("velocity_unit", "rated_torque", "metres_per_turn"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive, not {value}")

    @property
    def names(self) -> UnitNames:
        """Names of the units."""
        return ROTARY if self.metres_per_turn is None else LINEAR

    @property
    def defaults(self) -> AxisDefaults:
        """Defaults of limits, for an axis of this kind."""
        return ROTARY_DEFAULTS if self.metres_per_turn is None else LINEAR_DEFAULTS

    @property
    def per_motor_radian(self) -> float:
        """Way of the axis per radian of the motor: [1], or [m/rad] of a linear axis."""
        turn = 2 * math.pi if self.metres_per_turn is None else self.metres_per_turn
        return turn / (2 * math.pi * self.gear_ratio)

    @property
    def position_scale(self) -> float:
        """[rad] or [m] of one position count."""
        turn = 2 * math.pi if self.metres_per_turn is None else self.metres_per_turn
        return self.direction * turn / (self.counts_per_turn * self.gear_ratio)

    @property
    def velocity_scale(self) -> float:
        """[rad/s] or [m/s] of one velocity count."""
        if self.velocity_unit is None:
            return self.position_scale
        return self.direction * self.velocity_unit * self.per_motor_radian

    @property
    def torque_scale(self) -> float:
        """[N·m] or [N] of one torque count."""
        if self.rated_torque is None:
            raise ValueError("the rated torque is not known yet")
        return self.direction * self.rated_torque / self.per_motor_radian / 1000.0

    def apply(self, number: Number, unit: Unit) -> Number:
        """Return `number` with this axis' scale for `unit`; RAW: unchanged."""
        match unit:
            case Unit.POSITION:
                return replace(number, scale=self.position_scale, offset=self.offset)
            case Unit.DISTANCE:
                return replace(number, scale=self.position_scale, offset=0.0)
            case Unit.VELOCITY:
                return replace(number, scale=self.velocity_scale, offset=0.0)
            case Unit.SPEED:
                return replace(number, scale=abs(self.velocity_scale), offset=0.0)
            case Unit.TORQUE:
                return replace(number, scale=self.torque_scale, offset=0.0)
            case Unit.EFFORT:
                return replace(number, scale=abs(self.torque_scale), offset=0.0)
            case Unit.RAW:
                return replace(number, scale=1.0, offset=0.0)


def per_axis(name: str, value: V | Sequence[V], n: int) -> tuple[V, ...]:
    """Return one value for each of n axes, from one value (a str is one) or from n values."""
    if isinstance(value, str) or not isinstance(value, Sequence):
        return (value,) * n
    return one_each(name, value, n)


def one_each(name: str, values: Sequence[V], n: int) -> tuple[V, ...]:
    """Check the number of values."""
    if len(values) != n:
        raise ValueError(f"{name} has {len(values)} values for {n} axes")
    return tuple(values)

"""Conversion between the raw numbers of a drive and SI units at the joint, after the gear.

The units of a rotary axis are rad, rad/s and N·m; those of a linear axis (`metres_per_turn`) are m,
m/s and N.

CiA 402-2 §8 (factor group) lets the drive choose its units. The defaults are those of most drives:
position in encoder counts, velocity in counts per second, torque in thousandths of the rated torque
0x6076 (mN·m).
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
    """Names of the units of an axis, for reports and messages."""

    position: str
    velocity: str
    acceleration: str
    torque: str
    torque_limit: str = "torque_limit"  # name of the option of `Drives`

    @property
    def torque_slope(self) -> str:
        """Unit of a torque slope."""
        return f"{self.torque}/s"


ROTARY = UnitNames("rad", "rad/s", "rad/s²", "N·m")
LINEAR = UnitNames("m", "m/s", "m/s²", "N", "force_limit")


class AxisDefaults(NamedTuple):
    """Default limits of an axis, in its units."""

    velocity_limit: float  # default in CSP and PP
    step_limit: float  # smallest default step limit
    standstill: float  # velocity below which the axis is at rest
    deceleration: float  # for an axis without a velocity limit, whose only mode is "hm"


ROTARY_DEFAULTS = AxisDefaults(2 * math.pi, 0.1, 0.05, 25.0)
LINEAR_DEFAULTS = AxisDefaults(0.1, 0.005, 0.005, 0.4)


@dataclass(frozen=True, slots=True)
class AxisUnits:
    """Scales of an axis, from raw counts to units of the joint.

    Args:
        counts_per_turn: encoder counts per turn of the motor.
        gear_ratio: motor turns per joint turn.
        direction: +1, or -1 if the joint turns opposite to the motor.
        offset: position of the joint where the drive reads 0 [rad or m].
        velocity_unit: value of one raw velocity count [rad/s of the motor]; None for one position
            count per second.
        rated_torque: rated torque of the motor [N·m]; None until it is read from 0x6076.
        metres_per_turn: travel per turn of the gear output [m]; None for a rotary axis.

    Raises:
        ValueError: A value is out of range.
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
                f"gear_ratio must be positive, not {self.gear_ratio}; direction=-1 reverses an axis"
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
        """Default limits of a rotary or linear axis."""
        return ROTARY_DEFAULTS if self.metres_per_turn is None else LINEAR_DEFAULTS

    @property
    def per_motor_radian(self) -> float:
        """Travel of the axis per radian of the motor: [rad/rad], or [m/rad] of a linear axis."""
        turn = 2 * math.pi if self.metres_per_turn is None else self.metres_per_turn
        return turn / (2 * math.pi * self.gear_ratio)

    @property
    def position_scale(self) -> float:
        """Value of one position count [rad or m]."""
        turn = 2 * math.pi if self.metres_per_turn is None else self.metres_per_turn
        return self.direction * turn / (self.counts_per_turn * self.gear_ratio)

    @property
    def velocity_scale(self) -> float:
        """Value of one velocity count [rad/s or m/s]."""
        if self.velocity_unit is None:
            return self.position_scale
        return self.direction * self.velocity_unit * self.per_motor_radian

    @property
    def torque_scale(self) -> float:
        """Value of one torque count [N·m or N].

        Raises:
            ValueError: The rated torque has not been read yet.
        """
        if self.rated_torque is None:
            raise ValueError("the rated torque has not been read yet")
        return self.direction * self.rated_torque / self.per_motor_radian / 1000.0

    def apply(self, number: Number, unit: Unit) -> Number:
        """Return a number of the process data with the scale of this axis.

        Args:
            number: the number.
            unit: its unit; RAW means a scale of 1.

        Raises:
            ValueError: The unit is that of a torque, and the rated torque has not been read yet.
        """
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
    """Return one value per axis.

    Args:
        name: name of the option, for messages.
        value: one value for all axes (a str is one value), or a sequence with one per axis.
        n: number of axes.

    Raises:
        ValueError: The number of values is wrong.
    """
    if isinstance(value, str) or not isinstance(value, Sequence):
        return (value,) * n
    return one_each(name, value, n)


def one_each(name: str, values: Sequence[V], n: int) -> tuple[V, ...]:
    """Return the values as a tuple after a check of their number.

    Args:
        name: name of the option, for messages.
        values: one value per axis.
        n: number of axes.

    Raises:
        ValueError: The number of values is wrong.
    """
    if len(values) != n:
        raise ValueError(f"{name} has {len(values)} values for {n} axes")
    return tuple(values)

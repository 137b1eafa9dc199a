"""Motor of one CiA 402 axis, in SI units, with the presets of its parameters."""

from __future__ import annotations

import math

import msgspec

from catenary.virtual import _segment
from catenary.virtual.devices.servo_homing import homing_presets
from catenary.virtual.devices.servo_objects import profile_presets

POSITIVE = ("counts_per_turn", "inertia", "rated_torque", "max_torque_ratio", "max_velocity")
QUICK_DECELERATION = 1000  # rad/s²


class Motor(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Motor of an axis with its encoder and limits. ValueError if a value is out of range.

    Args:
        counts_per_turn: Position counts per turn of the motor.
        velocity_counts_per_turn: Value of 0x606C and 0x60FF at one turn per second; None:
            `counts_per_turn`.
        inertia: Motor inertia [kg·m²].
        viscous_friction: Viscous friction [N·m·s/rad].
        coulomb_friction: Dry friction [N·m].
        rated_torque: Rated torque [N·m].
        max_torque_ratio: Maximum torque divided by rated torque.
        max_velocity: Maximum velocity [rad/s].
        following_error_turns: Following error window [turns].
        position_limits: Software position limits (minimum, maximum) [rad]; None: no limits.
    """

    counts_per_turn: int = 1 << 20
    velocity_counts_per_turn: int | None = None
    inertia: float = 5e-4
    viscous_friction: float = 1e-3
    coulomb_friction: float = 0.02
    rated_torque: float = 2.0
    max_torque_ratio: float = 3.0
    max_velocity: float = 350.0
    following_error_turns: float = 0.25
    position_limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for field in POSITIVE:
            value = getattr(self, field)
            if not 0 < value < math.inf:
                raise ValueError(f"{field} must be positive, not {value}")
        if self.viscous_friction < 0 or self.coulomb_friction < 0:
            raise ValueError("friction must be 0 or more")

    @property
    def velocity_counts(self) -> int:
        """Value of 0x606C at one turn per second."""
        return self.velocity_counts_per_turn or self.counts_per_turn

    @property
    def counts_per_radian(self) -> float:
        """Position counts per radian of the motor."""
        return self.counts_per_turn / (2 * math.pi)

    @property
    def velocity_per_radian(self) -> float:
        """Value of 0x606C at 1 rad/s."""
        return self.velocity_counts / (2 * math.pi)

    def presets(self) -> dict[int, int]:
        """Return the initial values of the slots of the axis that follow from the motor."""
        low, high = self.position_limits or (0.0, 0.0)
        deceleration = round(QUICK_DECELERATION * self.velocity_per_radian)
        return {
            _segment.SLOT_DISABLE_OPTION: 1,
            _segment.SLOT_FAULT_OPTION: 2,
            _segment.SLOT_FOLLOWING_WINDOW: round(
                self.following_error_turns * self.counts_per_turn
            ),
            _segment.SLOT_FOLLOWING_TIME: 10,
            _segment.SLOT_LIMIT_MIN: round(low * self.counts_per_radian),
            _segment.SLOT_LIMIT_MAX: round(high * self.counts_per_radian),
            _segment.SLOT_MAX_TORQUE: round(1000 * self.max_torque_ratio),
            _segment.SLOT_MAX_SPEED: round(self.max_velocity * 60 / (2 * math.pi)),
            _segment.SLOT_QUICK_STOP_DECELERATION: deceleration,
            _segment.SLOT_DECELERATION: deceleration // 2,
            _segment.SLOT_INTERPOLATION_PERIOD: 1,
            _segment.SLOT_INTERPOLATION_EXPONENT: -3,
            **dict(profile_presets(self.counts_per_turn, self.velocity_counts)),
            **dict(homing_presets(self.velocity_per_radian)),
        }

"""Objects of homing (mode 6, CiA 402-2) for one axis. `servo_homing.h` implements the mode."""

from __future__ import annotations

from collections.abc import Callable

from catenary.virtual import _segment
from catenary.virtual.coe.dictionary import (
    ARRAY,
    INTEGER8,
    INTEGER32,
    UNSIGNED16,
    UNSIGNED32,
    Dictionary,
    Entry,
)
from catenary.virtual.devices.servo_objects import RW

HERE = 37
TORQUE = 300  # torque at which a stop is detected [per mille of the rated torque]


def add_homing(
    dictionary: Dictionary, base: int, slot: Callable[[str, int, int, int], Entry]
) -> None:
    """Add the homing objects.

    Args:
        dictionary: Object dictionary of the device.
        base: Offset of the axis, which is added to each index.
        slot: Function that returns an entry for a slot of the model.
    """
    add = dictionary.add_variable
    add(0x607C + base, slot("Home offset", INTEGER32, _segment.SLOT_HOME_OFFSET, RW))
    add(0x6098 + base, slot("Homing method", INTEGER8, _segment.SLOT_HOMING_METHOD, RW))
    speeds = [
        slot("Speed during search for switch", UNSIGNED32, _segment.SLOT_HOMING_SPEED, RW),
        slot("Speed during search for zero", UNSIGNED32, _segment.SLOT_HOMING_SLOW, RW),
    ]
    dictionary.add_record(0x6099 + base, "Homing speeds", speeds, code=ARRAY)
    acceleration = _segment.SLOT_HOMING_ACCELERATION
    add(0x609A + base, slot("Homing acceleration", UNSIGNED32, acceleration, RW))
    add(0x2110 + base, slot("Homing torque", UNSIGNED16, _segment.SLOT_HOMING_TORQUE, RW))


def homing_presets(velocity_per_radian: float) -> tuple[tuple[int, int], ...]:
    """Return the defaults as (slot, value): method 37, 1 and 0.2 rad/s, 10 rad/s², 30 % torque."""
    return (
        (_segment.SLOT_HOMING_METHOD, HERE),
        (_segment.SLOT_HOMING_SPEED, round(velocity_per_radian)),
        (_segment.SLOT_HOMING_SLOW, round(0.2 * velocity_per_radian)),
        (_segment.SLOT_HOMING_ACCELERATION, round(10 * velocity_per_radian)),
        (_segment.SLOT_HOMING_TORQUE, TORQUE),
    )

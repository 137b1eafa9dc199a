"""Objects of CiA 402 axes in the dictionary of a device, and the slots of the model for them.

Axis k has its objects 0x800·k above those of the first axis. It exists if the device has its
controlword 0x6040 and its statusword 0x6041.
"""

from __future__ import annotations

from collections.abc import Collection

from catenary.virtual import _segment
from catenary.virtual.coe.dictionary import SIGNED
from catenary.virtual.coe.object_facts import Place
from catenary.virtual.devices.servo_objects import OBJECTS, TX

CONTROLWORD, STATUSWORD, DIGITAL_INPUTS = 0x6040, 0x6041, 0x60FD
AXIS_STRIDE = 0x800
SLOT_OF: dict[Place, int] = {
    **{(each.index, 0): each.slot for each in OBJECTS},
    (0x607C, 0): _segment.SLOT_HOME_OFFSET,
    (0x607D, 1): _segment.SLOT_LIMIT_MIN,
    (0x607D, 2): _segment.SLOT_LIMIT_MAX,
    (0x6098, 0): _segment.SLOT_HOMING_METHOD,
    (0x6099, 1): _segment.SLOT_HOMING_SPEED,
    (0x6099, 2): _segment.SLOT_HOMING_SLOW,
    (0x609A, 0): _segment.SLOT_HOMING_ACCELERATION,
    (0x60C2, 1): _segment.SLOT_INTERPOLATION_PERIOD,
    (0x60C2, 2): _segment.SLOT_INTERPOLATION_EXPONENT,
    (0x60FE, 1): _segment.SLOT_DIGITAL_OUTPUTS,
}
WITH_SIGN = {
    *((each.index, 0) for each in OBJECTS if each.data_type in SIGNED),
    *((0x607C, 0), (0x607D, 1), (0x607D, 2), (0x6098, 0), (0x60C2, 2)),
}
# Slots that the model writes. The digital inputs are set from outside.
WRITTEN = {each.slot for each in OBJECTS if each.access == TX and each.index != DIGITAL_INPUTS}


def axis_offsets(places: Collection[Place]) -> tuple[int, ...]:
    """Return the offset of the objects of each axis, in ascending order.

    Args:
        places: Objects of the device.
    """
    offsets = (AXIS_STRIDE * axis for axis in range(_segment.AXES_MAX))
    return tuple(
        offset
        for offset in offsets
        if (CONTROLWORD + offset, 0) in places and (STATUSWORD + offset, 0) in places
    )


def axis_slots(offsets: Collection[int]) -> dict[Place, int]:
    """Return the slot of the model for each object of the axes.

    Args:
        offsets: Offsets of the axes.
    """
    return {
        (index + offset, subindex): _segment.SLOTS_PER_AXIS * axis + slot
        for axis, offset in enumerate(offsets)
        for (index, subindex), slot in SLOT_OF.items()
    }


def has_sign(place: Place) -> bool:
    """Return True if the model needs the sign of an object of an axis."""
    index, subindex = place
    return (0x6000 + (index - 0x6000) % AXIS_STRIDE, subindex) in WITH_SIGN

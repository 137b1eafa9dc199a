"""CiA 402-2 objects in the process data of an axis, with their width and unit.

In slot k of a device, their index is higher by SLOT_OFFSET · k (ETG.6010 §5.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from catenary.plan.request import ObjectReference
from catenary.wire.cia402 import SLOT_OFFSET, Object


class Unit(Enum):
    """Unit of an object, which determines its scale."""

    POSITION = "position"
    DISTANCE = "distance"  # difference of positions, without the offset of the axis
    VELOCITY = "velocity"
    SPEED = "speed"  # magnitude of a velocity, or its ramp
    TORQUE = "torque"
    EFFORT = "effort"  # magnitude of a torque
    RAW = "raw"  # raw number without a unit


@dataclass(frozen=True, slots=True)
class AxisObject:
    """One object of an axis."""

    index: int  # in slot 0
    subindex: int
    bit_length: int
    signed: bool = False
    unit: Unit = Unit.RAW
    output: bool = False  # True if the MainDevice sends it
    real: bool = False  # True for an IEEE 754 number
    scale: float | None = None  # factor of a RAW object with float values; None for integers

    def reference(self, slot: int, *, required: bool = True) -> ObjectReference:
        """Return the object of a slot for a process-data request.

        Args:
            slot: number of the slot.
            required: False if the device may lack the object.
        """
        index = self.index + SLOT_OFFSET * slot
        return ObjectReference(index, self.subindex, self.bit_length, required)


CONTROLWORD = AxisObject(Object.CONTROLWORD, 0, 16, False, Unit.RAW, True)
STATUSWORD = AxisObject(Object.STATUSWORD, 0, 16, False, Unit.RAW, False)
MODE_TARGET = AxisObject(Object.MODE_OF_OPERATION, 0, 8, True, Unit.RAW, True)
MODE_ACTUAL = AxisObject(Object.MODE_OF_OPERATION_DISPLAY, 0, 8, True, Unit.RAW, False)
ACTUAL_POSITION = AxisObject(Object.POSITION_ACTUAL, 0, 32, True, Unit.POSITION, False)
ACTUAL_VELOCITY = AxisObject(Object.VELOCITY_ACTUAL, 0, 32, True, Unit.VELOCITY, False)
TARGET_TORQUE = AxisObject(Object.TARGET_TORQUE, 0, 16, True, Unit.TORQUE, True)
ACTUAL_TORQUE = AxisObject(Object.TORQUE_ACTUAL, 0, 16, True, Unit.TORQUE, False)
POSITION_DEMAND = AxisObject(Object.POSITION_DEMAND, 0, 32, True, Unit.POSITION, False)
TORQUE_DEMAND = AxisObject(Object.TORQUE_DEMAND, 0, 16, True, Unit.TORQUE, False)
VELOCITY_OFFSET = AxisObject(Object.VELOCITY_OFFSET, 0, 32, True, Unit.VELOCITY, True)
TARGET_POSITION = AxisObject(Object.TARGET_POSITION, 0, 32, True, Unit.POSITION, True)
TARGET_VELOCITY = AxisObject(Object.TARGET_VELOCITY, 0, 32, True, Unit.VELOCITY, True)

MAX_TORQUE = AxisObject(Object.MAX_TORQUE, 0, 16, False, Unit.EFFORT, True)

# Objects of the profile modes. One count of a ramp is one velocity count per second.
PROFILE_OBJECTS: dict[str, AxisObject] = {
    "profile_velocity": AxisObject(Object.PROFILE_VELOCITY, 0, 32, False, Unit.SPEED, True),
    "profile_acceleration": AxisObject(Object.PROFILE_ACCELERATION, 0, 32, False, Unit.SPEED, True),
    "profile_deceleration": AxisObject(Object.PROFILE_DECELERATION, 0, 32, False, Unit.SPEED, True),
}

# Columns that can be requested by name, in the order of their indexes.
NAMED_COLUMNS: dict[str, AxisObject] = {
    "error_code": AxisObject(Object.ERROR_CODE, 0, 16, False, Unit.RAW, False),
    "position_demand": POSITION_DEMAND,
    "velocity_demand": AxisObject(0x606B, 0, 32, True, Unit.VELOCITY, False),
    "torque_demand": TORQUE_DEMAND,
    "max_torque": MAX_TORQUE,
    **PROFILE_OBJECTS,
    "velocity_offset": VELOCITY_OFFSET,
    "torque_offset": AxisObject(Object.TORQUE_OFFSET, 0, 16, True, Unit.TORQUE, True),
    "touch_probe_function": AxisObject(0x60B8, 0, 16, False, Unit.RAW, True),
    "touch_probe_status": AxisObject(0x60B9, 0, 16, False, Unit.RAW, False),
    "touch_probe_position": AxisObject(0x60BA, 0, 32, True, Unit.POSITION, False),
    "following_error": AxisObject(Object.FOLLOWING_ERROR_ACTUAL, 0, 32, True, Unit.DISTANCE, False),
    "digital_inputs": AxisObject(Object.DIGITAL_INPUTS, 0, 32, False, Unit.RAW, False),
    "digital_outputs": AxisObject(Object.DIGITAL_OUTPUTS, 1, 32, False, Unit.RAW, True),
}

# Objects that the MainDevice writes, as (index, subindex) in slot 0.
WRITTEN_OBJECTS = frozenset(
    (each.index, each.subindex)
    for each in (
        *NAMED_COLUMNS.values(),
        *(CONTROLWORD, MODE_TARGET, TARGET_POSITION, TARGET_VELOCITY, TARGET_TORQUE),
    )
    if each.output
)

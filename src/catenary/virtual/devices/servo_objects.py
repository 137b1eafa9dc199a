"""Objects of a CiA 402 axis, and the slots of the compiled model (`servo.h`) for their values."""

from __future__ import annotations

import math
from dataclasses import dataclass

from catenary.virtual import _segment
from catenary.virtual.coe.dictionary import (
    INTEGER8,
    INTEGER16,
    INTEGER32,
    MAP_RX,
    MAP_TX,
    READ_ANY,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    WRITE_ANY,
)

RO, RW = READ_ANY, READ_ANY | WRITE_ANY
RX, TX = RW | MAP_RX, RO | MAP_TX

BITS = {
    INTEGER8: 8,
    INTEGER16: 16,
    INTEGER32: 32,
    UNSIGNED8: 8,
    UNSIGNED16: 16,
    UNSIGNED32: 32,
}


@dataclass(frozen=True, slots=True)
class AxisObject:
    index: int
    name: str
    data_type: int
    access: int
    slot: int


OBJECTS = (
    AxisObject(
        0x6007,
        "Abort connection option code",
        INTEGER16,
        RW,
        _segment.SLOT_ABORT_CONNECTION_OPTION,
    ),
    AxisObject(0x603F, "Error code", UNSIGNED16, TX, _segment.SLOT_ERROR_CODE),
    AxisObject(0x6040, "Controlword", UNSIGNED16, RX, _segment.SLOT_CONTROLWORD),
    AxisObject(0x6041, "Statusword", UNSIGNED16, TX, _segment.SLOT_STATUSWORD),
    AxisObject(0x605A, "Quick stop option code", INTEGER16, RW, _segment.SLOT_QUICK_STOP_OPTION),
    AxisObject(0x605B, "Shutdown option code", INTEGER16, RW, _segment.SLOT_SHUTDOWN_OPTION),
    AxisObject(
        0x605C, "Disable operation option code", INTEGER16, RW, _segment.SLOT_DISABLE_OPTION
    ),
    AxisObject(0x605D, "Halt option code", INTEGER16, RW, _segment.SLOT_HALT_OPTION),
    AxisObject(0x605E, "Fault reaction option code", INTEGER16, RW, _segment.SLOT_FAULT_OPTION),
    AxisObject(0x6060, "Modes of operation", INTEGER8, RX, _segment.SLOT_MODE),
    AxisObject(0x6061, "Modes of operation display", INTEGER8, TX, _segment.SLOT_MODE_DISPLAY),
    AxisObject(0x6062, "Position demand value", INTEGER32, TX, _segment.SLOT_POSITION_DEMAND),
    AxisObject(0x6064, "Position actual value", INTEGER32, TX, _segment.SLOT_POSITION),
    AxisObject(0x6065, "Following error window", UNSIGNED32, RX, _segment.SLOT_FOLLOWING_WINDOW),
    AxisObject(0x6066, "Following error time out", UNSIGNED16, RX, _segment.SLOT_FOLLOWING_TIME),
    AxisObject(0x6067, "Position window", UNSIGNED32, RX, _segment.SLOT_POSITION_WINDOW),
    AxisObject(0x6068, "Position window time", UNSIGNED16, RX, _segment.SLOT_POSITION_WINDOW_TIME),
    AxisObject(0x606B, "Velocity demand value", INTEGER32, TX, _segment.SLOT_VELOCITY_DEMAND),
    AxisObject(0x606C, "Velocity actual value", INTEGER32, TX, _segment.SLOT_VELOCITY),
    AxisObject(0x606D, "Velocity window", UNSIGNED16, RX, _segment.SLOT_VELOCITY_WINDOW),
    AxisObject(0x606E, "Velocity window time", UNSIGNED16, RX, _segment.SLOT_VELOCITY_WINDOW_TIME),
    AxisObject(0x606F, "Velocity threshold", UNSIGNED16, RX, _segment.SLOT_VELOCITY_THRESHOLD),
    AxisObject(0x6071, "Target torque", INTEGER16, RX, _segment.SLOT_TARGET_TORQUE),
    AxisObject(0x6072, "Max torque", UNSIGNED16, RX, _segment.SLOT_MAX_TORQUE),
    AxisObject(0x6074, "Torque demand", INTEGER16, TX, _segment.SLOT_TORQUE_DEMAND),
    AxisObject(0x6077, "Torque actual value", INTEGER16, TX, _segment.SLOT_TORQUE),
    AxisObject(0x607A, "Target position", INTEGER32, RX, _segment.SLOT_TARGET_POSITION),
    AxisObject(0x6080, "Max motor speed", UNSIGNED32, RX, _segment.SLOT_MAX_SPEED),
    AxisObject(0x6081, "Profile velocity", UNSIGNED32, RX, _segment.SLOT_PROFILE_VELOCITY),
    AxisObject(0x6083, "Profile acceleration", UNSIGNED32, RX, _segment.SLOT_ACCELERATION),
    AxisObject(0x6084, "Profile deceleration", UNSIGNED32, RX, _segment.SLOT_DECELERATION),
    AxisObject(
        0x6085, "Quick stop deceleration", UNSIGNED32, RX, _segment.SLOT_QUICK_STOP_DECELERATION
    ),
    AxisObject(0x60B0, "Position offset", INTEGER32, RX, _segment.SLOT_POSITION_OFFSET),
    AxisObject(0x60B1, "Velocity offset", INTEGER32, RX, _segment.SLOT_VELOCITY_OFFSET),
    AxisObject(0x60B2, "Torque offset", INTEGER16, RX, _segment.SLOT_TORQUE_OFFSET),
    AxisObject(
        0x60F4, "Following error actual value", INTEGER32, TX, _segment.SLOT_FOLLOWING_ERROR
    ),
    AxisObject(0x60FD, "Digital inputs", UNSIGNED32, TX, _segment.SLOT_DIGITAL_INPUTS),
    AxisObject(0x60FF, "Target velocity", INTEGER32, RX, _segment.SLOT_TARGET_VELOCITY),
)
OBJECT_BY_INDEX = {o.index: o for o in OBJECTS}

# Default process data, in this order: 13 bytes in each direction.
DEFAULT_RX = (0x6040, 0x6060, 0x60FF, 0x607A, 0x6071)
DEFAULT_TX = (0x6041, 0x6061, 0x606C, 0x6064, 0x6077)


def profile_presets(counts: int, velocity_counts: int) -> tuple[tuple[int, int], ...]:
    """Return the defaults of the profile modes as (slot, value).

    They are 10 rad/s, 100 rad/s², the halt option, and the windows and threshold of bits 10 and 12.

    Args:
        counts: Position counts per turn.
        velocity_counts: Velocity value at one turn per second.
    """
    radian = velocity_counts / (2 * math.pi)
    return (
        (_segment.SLOT_PROFILE_VELOCITY, round(10 * radian)),
        (_segment.SLOT_ACCELERATION, round(100 * radian)),
        (_segment.SLOT_HALT_OPTION, 1),  # slow down with the ramp of 0x6084
        (_segment.SLOT_POSITION_WINDOW, max(counts // 4096, 1)),
        (_segment.SLOT_POSITION_WINDOW_TIME, 5),  # ms
        (_segment.SLOT_VELOCITY_WINDOW, min(max(round(0.1 * radian), 1), 0xFFFF)),
        (_segment.SLOT_VELOCITY_WINDOW_TIME, 5),  # ms
        (_segment.SLOT_VELOCITY_THRESHOLD, min(max(round(0.05 * radian), 1), 0xFFFF)),
    )

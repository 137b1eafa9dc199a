"""Data fields of MicroStrain's MIP protocol, converted to SI units.

Sources: github.com/LORD-MicroStrain/mip_sdk, src/c/mip/definitions/data_sensor.h, data_filter.h
and data_shared.h. All numbers are big endian.
"""

from __future__ import annotations

import struct
from typing import Literal, NamedTuple

from catenary.errors import DecodeError
from catenary.sensors.sensor import Channel

SENSOR_DATA = 0x80
FILTER_DATA = 0x82

STANDARD_GRAVITY = 9.80665  # [m/s²]
GAUSS = 1e-4  # [T]
MILLIBAR = 100.0  # [Pa]

WEEK_NS = 7 * 86_400 * 1_000_000_000

DeviceTime = Literal["reference", "gps", "filter_gps", "shared_gps", "external"]


class DataField(NamedTuple):
    """Layout of a field that becomes one channel."""

    descriptor_set: int
    descriptor: int
    length: int  # numbers of the channel
    code: str  # code of one number for `struct`: "f" or "H"
    unit: str
    scale: float = 1.0  # SI units per unit of the device
    has_flags: bool = False  # True if a u16 follows, 0 for invalid values


FIELDS: dict[str, DataField] = {
    "acceleration": DataField(SENSOR_DATA, 0x04, 3, "f", "m/s²", STANDARD_GRAVITY),
    "angular_velocity": DataField(SENSOR_DATA, 0x05, 3, "f", "rad/s"),
    "magnetic_field": DataField(SENSOR_DATA, 0x06, 3, "f", "T", GAUSS),
    "delta_angle": DataField(SENSOR_DATA, 0x07, 3, "f", "rad"),
    "delta_velocity": DataField(SENSOR_DATA, 0x08, 3, "f", "m/s", STANDARD_GRAVITY),
    "complementary_quaternion": DataField(SENSOR_DATA, 0x0A, 4, "f", ""),
    "complementary_euler": DataField(SENSOR_DATA, 0x0C, 3, "f", "rad"),
    "pressure": DataField(SENSOR_DATA, 0x17, 1, "f", "Pa", MILLIBAR),
    "quaternion": DataField(FILTER_DATA, 0x03, 4, "f", "", has_flags=True),
    "euler": DataField(FILTER_DATA, 0x05, 3, "f", "rad", has_flags=True),
    "linear_acceleration": DataField(FILTER_DATA, 0x0D, 3, "f", "m/s²", has_flags=True),
    "filter_angular_velocity": DataField(FILTER_DATA, 0x0E, 3, "f", "rad/s", has_flags=True),
    "filter_status": DataField(FILTER_DATA, 0x10, 3, "H", ""),  # state, dynamics mode, flags
    "filter_acceleration": DataField(FILTER_DATA, 0x1C, 3, "f", "m/s²", has_flags=True),
}

# The shared fields 0xD0 and above have the same layout in each data set.
TIMES: dict[DeviceTime, int] = {
    "reference": 0xD5,  # u64 [ns] since the start of the device; never jumps
    "gps": 0x12,  # double [s] of the week, u16 week, u16 flags; sensor data
    "filter_gps": 0x11,  # as 0x12; filter data
    "shared_gps": 0xD3,  # as 0x12
    "external": 0xD7,  # u64 [ns], u16 flags; synchronised with PPS
}
NANOSECONDS = struct.Struct(">Q")
WEEK_TIME = struct.Struct(">dHH")


def make_channel(name: str) -> Channel:
    """Return the channel of a field of the table."""
    field = FIELDS[name]
    return Channel(name, field.unit, () if field.length == 1 else (field.length,))


def decode_values(field: DataField, data: bytes) -> tuple[tuple[float, ...], bool]:
    """Return the values of a field in SI units, and False if the device marks them as invalid.

    Args:
        field: layout of the field.
        data: bytes after the descriptor.

    Raises:
        DecodeError: The field has another length.
    """
    layout = struct.Struct(f">{field.length}{field.code}{'H' if field.has_flags else ''}")
    if len(data) != layout.size:
        raise DecodeError(
            f"MIP field 0x{field.descriptor_set:02X}, 0x{field.descriptor:02X} has {len(data)}"
            f" bytes instead of {layout.size}"
        )
    numbers = layout.unpack(data)
    values = tuple(number * field.scale for number in numbers[: field.length])
    return values, not field.has_flags or bool(numbers[-1])


def decode_time(kind: DeviceTime, data: bytes) -> int:
    """Return the time in a field [ns]. GPS times count from the start of GPS week 0.

    Their flags are not used. Without GPS, the device sends its own time in the same field, which
    may jump when the device is synchronised.

    Args:
        kind: kind of the time.
        data: bytes after the descriptor.

    Raises:
        DecodeError: The field is too short, or the time of the week is not in the week.
    """
    try:
        if kind in ("reference", "external"):
            nanoseconds: int = NANOSECONDS.unpack_from(data)[0]
            return nanoseconds
        fields: tuple[float, int, int] = WEEK_TIME.unpack_from(data)
    except struct.error:
        raise DecodeError(f"the {kind} time of a MIP packet has only {len(data)} bytes") from None
    seconds, week, _ = fields
    if not 0.0 <= seconds <= WEEK_NS * 1e-9:  # also excludes NaN
        raise DecodeError(f"the {kind} time of a MIP packet is {seconds} s of the week")
    return week * WEEK_NS + round(seconds * 1e9)

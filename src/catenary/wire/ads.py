"""Requests of the ADS services, ETG.1020: the data of AoE messages to a device.

Every request is a frozen value with `encode()`. `decode_request` decodes the requests of a service.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, TypeAlias

from catenary.errors import DecodeError
from catenary.wire.aoe import Command

_PLACE = struct.Struct("<III")  # index group, index offset, length
_READ_WRITE = struct.Struct("<IIII")
_HANDLE = struct.Struct("<I")
_CONTROL = struct.Struct("<HHI")
_SUBSCRIPTION = struct.Struct("<IIIIII16x")


class Transmission(IntEnum):
    """Cause of a notification."""

    CYCLIC = 3
    ON_CHANGE = 4


def pack(layout: struct.Struct, *numbers: int) -> bytes:
    """Return packed numbers. Raises ValueError if one does not fit."""
    try:
        return layout.pack(*numbers)
    except struct.error as error:
        raise ValueError(f"ADS: {numbers} do not fit: {error}") from None


@dataclass(frozen=True, slots=True)
class Read:
    """Request to read `size` bytes."""

    command: ClassVar[Command] = Command.READ
    group: int
    offset: int
    size: int

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return pack(_PLACE, self.group, self.offset, self.size)


@dataclass(frozen=True, slots=True)
class Write:
    """Request to write data."""

    command: ClassVar[Command] = Command.WRITE
    group: int
    offset: int
    data: bytes

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return pack(_PLACE, self.group, self.offset, len(self.data)) + self.data


@dataclass(frozen=True, slots=True)
class ReadWrite:
    """Request to write data and to read `size` bytes."""

    command: ClassVar[Command] = Command.READ_WRITE
    group: int
    offset: int
    size: int
    data: bytes

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return pack(_READ_WRITE, self.group, self.offset, self.size, len(self.data)) + self.data


@dataclass(frozen=True, slots=True)
class WriteControl:
    """Request to change the state of the device."""

    command: ClassVar[Command] = Command.WRITE_CONTROL
    ads_state: int
    device_state: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return pack(_CONTROL, self.ads_state, self.device_state, len(self.data)) + self.data


@dataclass(frozen=True, slots=True)
class AddNotification:
    """Request to send a value repeatedly. Times have the unit 100 ns."""

    command: ClassVar[Command] = Command.ADD_NOTIFICATION
    group: int
    offset: int
    size: int
    transmission: int = Transmission.ON_CHANGE
    max_delay: int = 0
    cycle_time: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        times = (self.transmission, self.max_delay, self.cycle_time)
        return pack(_SUBSCRIPTION, self.group, self.offset, self.size, *times)


@dataclass(frozen=True, slots=True)
class DeleteNotification:
    """Request to end a notification."""

    command: ClassVar[Command] = Command.DELETE_NOTIFICATION
    handle: int

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return pack(_HANDLE, self.handle)


@dataclass(frozen=True, slots=True)
class ReadDeviceInfo:
    """Request to read the name and the version of the device."""

    command: ClassVar[Command] = Command.READ_DEVICE_INFO

    def encode(self) -> bytes:
        """Return the encoded bytes."""
        return b""


@dataclass(frozen=True, slots=True)
class ReadState:
    """Request to read the state of the device."""

    command: ClassVar[Command] = Command.READ_STATE

    def encode(self) -> bytes:
        """Return the encoded bytes."""
        return b""


Request: TypeAlias = (
    Read
    | Write
    | ReadWrite
    | WriteControl
    | AddNotification
    | DeleteNotification
    | ReadDeviceInfo
    | ReadState
)


def decode_request(command: int, data: bytes) -> Request:
    """Decode the data of a request. Data of a write must have exactly the announced length."""
    match command:
        case Command.READ_DEVICE_INFO:
            return ReadDeviceInfo()
        case Command.READ_STATE:
            return ReadState()
        case Command.READ:
            return Read(*unpack(_PLACE, data))
        case Command.WRITE:
            group, offset, size = unpack(_PLACE, data)
            return Write(group, offset, exactly(data[_PLACE.size :], size))
        case Command.READ_WRITE:
            group, offset, read_size, size = unpack(_READ_WRITE, data)
            return ReadWrite(group, offset, read_size, exactly(data[_READ_WRITE.size :], size))
        case Command.WRITE_CONTROL:
            ads_state, device_state, size = unpack(_CONTROL, data)
            return WriteControl(ads_state, device_state, exactly(data[_CONTROL.size :], size))
        case Command.ADD_NOTIFICATION:
            return AddNotification(*unpack(_SUBSCRIPTION, data))
        case Command.DELETE_NOTIFICATION:
            return DeleteNotification(*unpack(_HANDLE, data))
    raise DecodeError(f"ADS: unknown request {command}")


def unpack(layout: struct.Struct, data: bytes) -> tuple[int, ...]:
    """Return the numbers at the start of the data. Raises DecodeError if they are too short."""
    if len(data) < layout.size:
        raise DecodeError(f"ADS: needs {layout.size} bytes, received {len(data)}")
    return layout.unpack_from(data)


def exactly(data: bytes, size: int) -> bytes:
    """Return the data. Raises DecodeError unless they have the announced size."""
    if len(data) != size:
        raise DecodeError(f"ADS: {size} bytes announced, {len(data)} received")
    return bytes(data)

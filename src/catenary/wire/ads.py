"""Data of the ADS services, ETG.1020: requests, responses and notifications of AoE messages.

Every request is a frozen value with `encode()`. `decode_request` decodes the requests of a service.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, NamedTuple, TypeAlias

from catenary.errors import DecodeError
from catenary.wire.aoe import Command

NAME_SIZE = 16  # of the device name [bytes]
NOTIFICATIONS_MAX = 1024  # samples of one notification; more are refused
_PLACE = struct.Struct("<III")  # index group, index offset, length
_READ_WRITE = struct.Struct("<IIII")
_RESULT = struct.Struct("<I")
_DATA = struct.Struct("<II")  # result, length
_INFO = struct.Struct(f"<IBBH{NAME_SIZE}s")
_STATE = struct.Struct("<IHH")
_CONTROL = struct.Struct("<HHI")
_SUBSCRIPTION = struct.Struct("<IIIIII16x")
_STAMPS = struct.Struct("<II")  # length, number of stamps
_STAMP = struct.Struct("<QI")  # time, number of samples
_SAMPLE = struct.Struct("<II")  # handle, length


class AdsState(IntEnum):
    """State of an ADS device. Devices may use further values."""

    INVALID = 0
    IDLE = 1
    RESET = 2
    INIT = 3
    START = 4
    RUN = 5
    STOP = 6
    SAVE_CONFIGURATION = 7
    LOAD_CONFIGURATION = 8
    POWER_FAILURE = 9
    POWER_GOOD = 10
    ERROR = 11
    SHUTDOWN = 12
    SUSPEND = 13
    RESUME = 14
    CONFIGURATION = 15
    RECONFIGURATION = 16


class Transmission(IntEnum):
    """Cause of a notification."""

    CYCLIC = 3
    ON_CHANGE = 4


def _pack(layout: struct.Struct, *numbers: int) -> bytes:
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
        return _pack(_PLACE, self.group, self.offset, self.size)


@dataclass(frozen=True, slots=True)
class Write:
    """Request to write data."""

    command: ClassVar[Command] = Command.WRITE
    group: int
    offset: int
    data: bytes

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(_PLACE, self.group, self.offset, len(self.data)) + self.data


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
        return _pack(_READ_WRITE, self.group, self.offset, self.size, len(self.data)) + self.data


@dataclass(frozen=True, slots=True)
class WriteControl:
    """Request to change the state of the device."""

    command: ClassVar[Command] = Command.WRITE_CONTROL
    ads_state: int
    device_state: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(_CONTROL, self.ads_state, self.device_state, len(self.data)) + self.data


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
        return _pack(_SUBSCRIPTION, self.group, self.offset, self.size, *times)


@dataclass(frozen=True, slots=True)
class DeleteNotification:
    """Request to end a notification."""

    command: ClassVar[Command] = Command.DELETE_NOTIFICATION
    handle: int

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(_RESULT, self.handle)


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
            return Read(*_unpack(_PLACE, data))
        case Command.WRITE:
            group, offset, size = _unpack(_PLACE, data)
            return Write(group, offset, _exactly(data[_PLACE.size :], size))
        case Command.READ_WRITE:
            group, offset, read_size, size = _unpack(_READ_WRITE, data)
            return ReadWrite(group, offset, read_size, _exactly(data[_READ_WRITE.size :], size))
        case Command.WRITE_CONTROL:
            ads_state, device_state, size = _unpack(_CONTROL, data)
            return WriteControl(ads_state, device_state, _exactly(data[_CONTROL.size :], size))
        case Command.ADD_NOTIFICATION:
            return AddNotification(*_unpack(_SUBSCRIPTION, data))
        case Command.DELETE_NOTIFICATION:
            return DeleteNotification(*_unpack(_RESULT, data))
    raise DecodeError(f"ADS: unknown request {command}")


def _unpack(layout: struct.Struct, data: bytes) -> tuple[int, ...]:
    if len(data) < layout.size:
        raise DecodeError(f"ADS: needs {layout.size} bytes, received {len(data)}")
    return layout.unpack_from(data)


def _exactly(data: bytes, size: int) -> bytes:
    if len(data) != size:
        raise DecodeError(f"ADS: {size} bytes announced, {len(data)} received")
    return bytes(data)


def decode_result(data: bytes) -> int:
    """Decode the result at the start of each response; 0 is success."""
    return _unpack(_RESULT, data)[0]


def decode_data(data: bytes) -> bytes:
    """Decode the data of a response to a read. The announced length must be the received one."""
    return _exactly(data[_DATA.size :], _unpack(_DATA, data)[1])


def encode_result(code: int, data: bytes | None = None) -> bytes:
    """Return the data of a response: the result, and the length and data of a read."""
    return _pack(_RESULT, code) if data is None else _pack(_DATA, code, len(data)) + data


class DeviceInfo(NamedTuple):
    """Name and version of an ADS device."""

    name: str
    version: int
    revision: int
    build: int

    def encode(self) -> bytes:
        """Return the data of a successful response."""
        return _INFO.pack(
            0, self.version, self.revision, self.build, self.name.encode("latin-1")[:NAME_SIZE]
        )


def decode_device_info(data: bytes) -> DeviceInfo:
    """Decode a successful response to `ReadDeviceInfo`."""
    if len(data) < _INFO.size:
        raise DecodeError(f"ADS device info: needs {_INFO.size} bytes, received {len(data)}")
    _result, version, revision, build, name = _INFO.unpack_from(data)
    text: str = name.split(b"\0", 1)[0].decode("latin-1")
    return DeviceInfo(text, version, revision, build)


class States(NamedTuple):
    """State of an ADS device, and a state whose meaning the device defines."""

    ads_state: int
    device_state: int

    @property
    def name(self) -> str:
        """Name of the ADS state, such as "RUN"; "state 99" if it is not a standard one."""
        known = {int(state): state.name for state in AdsState}
        return known.get(self.ads_state, f"state {self.ads_state}")

    def encode(self) -> bytes:
        """Return the data of a successful response."""
        return _pack(_STATE, 0, self.ads_state, self.device_state)


def decode_states(data: bytes) -> States:
    """Decode a successful response to `ReadState`."""
    return States(*_unpack(_STATE, data)[1:])


def decode_handle(data: bytes) -> int:
    """Decode a successful response to `AddNotification`: the handle of the notification."""
    return _unpack(_DATA, data)[1]


def encode_handle(handle: int) -> bytes:
    """Return the data of a successful response to `AddNotification`."""
    return _pack(_DATA, 0, handle)


class Sample(NamedTuple):
    """One value of a notification. `time` is that of the device [100 ns since 1601-01-01]."""

    handle: int
    time: int
    data: bytes


def encode_notification(samples: tuple[Sample, ...]) -> bytes:
    """Return the data of a notification, with one stamp per sample."""
    stamps = b"".join(
        struct.pack("<QI", each.time, 1) + _pack(_SAMPLE, each.handle, len(each.data)) + each.data
        for each in samples
    )
    return _pack(_STAMPS, len(stamps) + 4, len(samples)) + stamps


def decode_notification(data: bytes) -> tuple[Sample, ...]:
    """Decode the data of a notification. Raises DecodeError if a length exceeds the data."""
    _length, stamps = _unpack(_STAMPS, data)
    found: list[Sample] = []
    place = _STAMPS.size
    for _ in range(_bounded(stamps)):
        time, samples = _unpack(_STAMP, data[place:])
        place += _STAMP.size
        for _ in range(_bounded(samples)):
            handle, size = _unpack(_SAMPLE, data[place:])
            place += _SAMPLE.size
            if place + size > len(data):
                raise DecodeError(f"ADS: a sample of {size} bytes exceeds the notification")
            found.append(Sample(handle, time, bytes(data[place : place + size])))
            place += size
    return tuple(found)


def _bounded(number: int) -> int:
    if number > NOTIFICATIONS_MAX:
        raise DecodeError(f"ADS: {number} samples in a notification; at most {NOTIFICATIONS_MAX}")
    return number

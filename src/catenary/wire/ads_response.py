"""Responses and notifications of the ADS services, ETG.1020: the data of AoE messages."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import NamedTuple

from catenary.errors import DecodeError
from catenary.wire.ads import exactly, pack, unpack

NAME_SIZE = 16  # of the device name [bytes]
NOTIFICATIONS_MAX = 1024  # samples of one notification; more are refused
_RESULT = struct.Struct("<I")
_DATA = struct.Struct("<II")  # result, length
_INFO = struct.Struct(f"<IBBH{NAME_SIZE}s")
_STATE = struct.Struct("<IHH")
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


def decode_result(data: bytes) -> int:
    """Decode the result at the start of each response; 0 is success."""
    return unpack(_RESULT, data)[0]


def decode_data(data: bytes) -> bytes:
    """Decode the data of a response to a read. The announced length must be the received one."""
    return exactly(data[_DATA.size :], unpack(_DATA, data)[1])


def encode_result(code: int, data: bytes | None = None) -> bytes:
    """Return the data of a response: the result, and the length and data of a read."""
    return pack(_RESULT, code) if data is None else pack(_DATA, code, len(data)) + data


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
    """State of an ADS device. The device defines the meaning of `device_state`."""

    ads_state: int
    device_state: int

    @property
    def name(self) -> str:
        """Name of the ADS state, such as "RUN"; "state 99" if it is not a standard one."""
        known = {int(state): state.name for state in AdsState}
        return known.get(self.ads_state, f"state {self.ads_state}")

    def encode(self) -> bytes:
        """Return the data of a successful response."""
        return pack(_STATE, 0, self.ads_state, self.device_state)


def decode_states(data: bytes) -> States:
    """Decode a successful response to `ReadState`."""
    return States(*unpack(_STATE, data)[1:])


def decode_handle(data: bytes) -> int:
    """Decode a successful response to `AddNotification`: the handle of the notification."""
    return unpack(_DATA, data)[1]


def encode_handle(handle: int) -> bytes:
    """Return the data of a successful response to `AddNotification`."""
    return pack(_DATA, 0, handle)


class Sample(NamedTuple):
    """One value of a notification. `time` is that of the device [100 ns since 1601-01-01]."""

    handle: int
    time: int
    data: bytes


def encode_notification(samples: tuple[Sample, ...]) -> bytes:
    """Return the data of a notification, with one stamp per sample."""
    stamps = b"".join(
        struct.pack("<QI", each.time, 1) + pack(_SAMPLE, each.handle, len(each.data)) + each.data
        for each in samples
    )
    return pack(_STAMPS, len(stamps) + 4, len(samples)) + stamps


def decode_notification(data: bytes) -> tuple[Sample, ...]:
    """Decode the data of a notification. Raises DecodeError if a length exceeds the data."""
    length, stamps = unpack(_STAMPS, data)
    if 4 + length > len(data):
        raise DecodeError(f"ADS: a notification of {4 + length} bytes, {len(data)} received")
    found: list[Sample] = []
    place = _STAMPS.size
    for _ in range(_bounded(stamps)):
        time, samples = unpack(_STAMP, data[place:])
        place += _STAMP.size
        for _ in range(_bounded(samples)):
            handle, size = unpack(_SAMPLE, data[place:])
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

"""Ethernet over EtherCAT (EoE), ETG.1000.6 §5.7.

Every message is a frozen value with `encode()`. `decode_eoe` decodes the data of a mailbox message.
All messages start with two words:

    type (4 bits), port (4), last fragment, time stamp appended, time stamp requested
    fragment (6 bits), offset or size in blocks of 32 bytes (6), frame (4)   of fragments
    result                                                                   of other responses

The codecs of addresses and filters are in `wire/eoe_address.py`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import TypeAlias

from catenary.errors import DecodeError
from catenary.wire.eoe_address import (
    EthernetAddress,
    MacFilter,
    decode_address,
    decode_filter,
)

HEADER_SIZE = 4
BLOCK = 32  # [bytes], unit of offsets; all fragments but the last contain whole blocks
TIME_STAMP_SIZE = 4
FRAME_NUMBERS = 16
LAST, TIME_APPENDED, TIME_REQUESTED = 0x0100, 0x0200, 0x0400  # in the first word
_HEADER = struct.Struct("<HH")
_TIME = struct.Struct("<I")


class FrameType(IntEnum):
    """Service of a message, ETG.1000.6 §5.7.3."""

    FRAGMENT = 0
    TIME_STAMP = 1
    SET_ADDRESS = 2
    SET_ADDRESS_RESULT = 3
    SET_FILTER = 4
    SET_FILTER_RESULT = 5
    GET_ADDRESS = 6
    GET_ADDRESS_RESULT = 7
    GET_FILTER = 8
    GET_FILTER_RESULT = 9


class Result(IntEnum):
    """Result of a request. Devices also use codes of mailbox errors (SOES, esc_eoe.c)."""

    SUCCESS = 0x0000
    UNSPECIFIED = 0x0001
    UNSUPPORTED_TYPE = 0x0002
    NO_IP_SUPPORT = 0x0201
    NO_DHCP_SUPPORT = 0x0202
    NO_FILTER_SUPPORT = 0x0401


RESULT_TEXTS: Mapping[int, str] = {
    Result.SUCCESS: "success",
    Result.UNSPECIFIED: "unspecified error",
    Result.UNSUPPORTED_TYPE: "the device does not support this request",
    Result.NO_IP_SUPPORT: "the device has no IP address that can be set",
    Result.NO_DHCP_SUPPORT: "the device does not support DHCP",
    Result.NO_FILTER_SUPPORT: "the device has no address filter",
}


def result_text(result: int) -> str:
    """Return the meaning of a result."""
    return RESULT_TEXTS.get(result, "code of the vendor")


def _pack(kind: FrameType, port: int, low: int = 0, high: int = LAST, rest: bytes = b"") -> bytes:
    """Return the encoded bytes of a message.

    Args:
        kind: Type of the message.
        port: Port of the device.
        low: Second word.
        high: Flags of the first word. Requests also have LAST, as in SOEM (ec_eoe.c).
        rest: Data after the header.
    """
    if not 0 <= port <= 15 or not 0 <= low <= 0xFFFF:
        raise ValueError(f"EoE {kind.name}: port {port} or word 0x{low:X} does not fit")
    return _HEADER.pack(kind | port << 4 | high, low) + rest


@dataclass(frozen=True, slots=True)
class Fragment:
    """A part of an Ethernet frame, §5.7.2.

    `blocks` is the size of the frame in fragment 0, and the offset of the data in the others, in
    units of 32 bytes. A time stamp [ns] follows the data of the last fragment if it is not None.
    """

    number: int
    blocks: int
    frame: int  # 0 to 15; equal in all fragments of one frame
    data: bytes
    last: bool = True
    time_stamp: int | None = None
    time_requested: bool = False
    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        fits = 0 <= self.number < 64 and 0 <= self.blocks < 64 and 0 <= self.frame < FRAME_NUMBERS
        if not fits or (self.time_stamp is not None and not self.last):
            raise ValueError(f"EoE FRAGMENT: a field does not fit in {self}")
        time = b"" if self.time_stamp is None else _time(self.time_stamp)
        flags = (
            (LAST if self.last else 0)
            | (TIME_APPENDED if time else 0)
            | (TIME_REQUESTED if self.time_requested else 0)
        )
        word = self.number | self.blocks << 6 | self.frame << 12
        return _pack(FrameType.FRAGMENT, self.port, word, flags, self.data + time)


@dataclass(frozen=True, slots=True)
class TimeStamp:
    """Time at which a frame was sent [ns], §5.7.3: the answer to a requested time stamp."""

    frame: int
    time_stamp: int
    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        if not 0 <= self.frame < FRAME_NUMBERS:
            raise ValueError(f"EoE TIME_STAMP: frame {self.frame} does not fit")
        rest = _time(self.time_stamp)
        return _pack(FrameType.TIME_STAMP, self.port, self.frame << 12, rest=rest)


@dataclass(frozen=True, slots=True)
class SetAddress:
    """Request to set the addresses of a device, §5.7.4."""

    address: EthernetAddress
    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(FrameType.SET_ADDRESS, self.port, rest=self.address.encode())


@dataclass(frozen=True, slots=True)
class SetAddressResult:
    """Answer to `SetAddress`. Stacks also answer unsupported requests with it (SSC, ecateoe.c)."""

    result: int = 0
    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(FrameType.SET_ADDRESS_RESULT, self.port, self.result)


@dataclass(frozen=True, slots=True)
class GetAddress:
    """Request to read the addresses of a device."""

    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(FrameType.GET_ADDRESS, self.port)


@dataclass(frozen=True, slots=True)
class GetAddressResult:
    """Answer to `GetAddress`; without an address if the device only sends a result."""

    address: EthernetAddress | None
    result: int = 0
    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        rest = b"" if self.address is None else self.address.encode()
        return _pack(FrameType.GET_ADDRESS_RESULT, self.port, self.result, rest=rest)


@dataclass(frozen=True, slots=True)
class SetFilter:
    """Request to set the address filter of a device, §5.7.5."""

    filter: MacFilter
    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(FrameType.SET_FILTER, self.port, rest=self.filter.encode())


@dataclass(frozen=True, slots=True)
class SetFilterResult:
    """Answer to `SetFilter`."""

    result: int = 0
    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(FrameType.SET_FILTER_RESULT, self.port, self.result)


@dataclass(frozen=True, slots=True)
class GetFilter:
    """Request to read the address filter of a device."""

    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        return _pack(FrameType.GET_FILTER, self.port)


@dataclass(frozen=True, slots=True)
class GetFilterResult:
    """Answer to `GetFilter`; without a filter if the device only sends a result."""

    filter: MacFilter | None
    result: int = 0
    port: int = 0

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        rest = b"" if self.filter is None else self.filter.encode()
        return _pack(FrameType.GET_FILTER_RESULT, self.port, self.result, rest=rest)


Message: TypeAlias = (
    Fragment
    | TimeStamp
    | SetAddress
    | SetAddressResult
    | GetAddress
    | GetAddressResult
    | SetFilter
    | SetFilterResult
    | GetFilter
    | GetFilterResult
)


def decode_eoe(data: bytes) -> Message:
    """Decode the data of a mailbox message of type EOE."""
    if len(data) < HEADER_SIZE:
        raise DecodeError(f"EoE: needs {HEADER_SIZE} bytes, received {len(data)}")
    flags, word = _HEADER.unpack_from(data)
    rest, port = bytes(data[HEADER_SIZE:]), flags >> 4 & 0x0F
    kind = flags & 0x0F
    if kind == FrameType.FRAGMENT:
        return _fragment(flags, word, rest, port)
    decode = _DECODERS.get(kind)
    if decode is None:
        raise DecodeError(f"EoE: unknown type {kind}")
    return decode(word, rest, port)


def _fragment(flags: int, word: int, rest: bytes, port: int) -> Fragment:
    last, time_stamp = bool(flags & LAST), None
    # Only a last fragment has a time stamp, as in SOEM (ec_eoe.c) and the SSC (ecateoe.c).
    if last and flags & TIME_APPENDED:
        rest, time_stamp = rest[:-TIME_STAMP_SIZE], _decode_time(rest[-TIME_STAMP_SIZE:])
    return Fragment(
        number=word & 0x3F,
        blocks=word >> 6 & 0x3F,
        frame=word >> 12,
        data=rest,
        last=last,
        time_stamp=time_stamp,
        time_requested=bool(flags & TIME_REQUESTED),
        port=port,
    )


_DECODERS: Mapping[int, Callable[[int, bytes, int], Message]] = {
    FrameType.TIME_STAMP: lambda word, rest, port: TimeStamp(word >> 12, _decode_time(rest), port),
    FrameType.SET_ADDRESS: lambda _, rest, port: SetAddress(decode_address(rest), port),
    FrameType.SET_ADDRESS_RESULT: lambda word, _, port: SetAddressResult(word, port),
    FrameType.SET_FILTER: lambda _, rest, port: SetFilter(decode_filter(rest), port),
    FrameType.SET_FILTER_RESULT: lambda word, _, port: SetFilterResult(word, port),
    FrameType.GET_ADDRESS: lambda _word, _rest, port: GetAddress(port),
    FrameType.GET_ADDRESS_RESULT: lambda word, rest, port: GetAddressResult(
        decode_address(rest) if rest else None, word, port
    ),
    FrameType.GET_FILTER: lambda _word, _rest, port: GetFilter(port),
    FrameType.GET_FILTER_RESULT: lambda word, rest, port: GetFilterResult(
        decode_filter(rest) if rest else None, word, port
    ),
}


def _time(time_stamp: int) -> bytes:
    if not 0 <= time_stamp <= 0xFFFF_FFFF:
        raise ValueError(f"EoE: time stamp {time_stamp} does not fit into 32 bits")
    return _TIME.pack(time_stamp)


def _decode_time(data: bytes) -> int:
    if len(data) < TIME_STAMP_SIZE:
        raise DecodeError(f"EoE: a time stamp needs {TIME_STAMP_SIZE} bytes, received {len(data)}")
    [time_stamp] = _TIME.unpack_from(data)
    return int(time_stamp)

"""Mailbox header and mailbox error reply, ETG.1000.4 §5.6 (annex of ETG.1000.6 §5.1)."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from catenary.errors import DecodeError

HEADER_SIZE = 6
COUNTERS = range(1, 8)  # 0 means no counter
_HEADER = struct.Struct("<HHBB")
_ERROR = struct.Struct("<HH")
_ERROR_TYPE = 0x0001


class Type(IntEnum):
    """Protocol of a mailbox message."""

    ERROR = 0
    AOE = 1
    EOE = 2
    COE = 3
    FOE = 4
    SOE = 5
    VOE = 15


@dataclass(frozen=True, slots=True)
class Mailbox:
    """One mailbox message. Bytes after it in the SyncManager's buffer are ignored."""

    type: Type
    data: bytes
    counter: int = 0  # 1 to 7, incremented with each new message; 1 follows 7
    address: int = 0  # station address of the partner; 0 is the MainDevice
    priority: int = 0  # 0 to 3
    channel: int = 0

    def encode(self, size: int | None = None) -> bytes:
        """Return the encoded bytes, padded with zeros to the `size` of the mailbox.

        The padding is required: a device receives a message when the last byte of its mailbox is
        written. Raises ValueError if the message does not fit.
        """
        if not (0 <= self.counter <= 7 and 0 <= self.priority <= 3 and 0 <= self.channel < 64):
            raise ValueError(f"mailbox: counter, priority or channel out of range in {self}")
        try:
            header = _HEADER.pack(
                *(len(self.data), self.address),
                *(self.channel | self.priority << 6, self.type | self.counter << 4),
            )
        except struct.error as error:
            raise ValueError(f"mailbox: {error}") from None
        message = header + self.data
        if size is not None and len(message) > size:
            raise ValueError(
                f"mailbox message of {len(message)} bytes exceeds the mailbox of {size} bytes"
            )
        return message.ljust(size or 0, b"\x00")


def decode_mailbox(data: bytes) -> Mailbox:
    """Decode the message at the start of a mailbox buffer."""
    if len(data) < HEADER_SIZE:
        raise DecodeError(f"mailbox header: needs {HEADER_SIZE} bytes, received {len(data)}")
    length, address, channel, kind = _HEADER.unpack_from(data)
    if HEADER_SIZE + length > len(data):
        raise DecodeError(
            f"mailbox: header specifies {length} bytes, {len(data) - HEADER_SIZE} received"
        )
    try:
        protocol = Type(kind & 0x0F)
    except ValueError:
        raise DecodeError(f"mailbox: unknown protocol {kind & 0x0F}") from None
    payload = bytes(data[HEADER_SIZE : HEADER_SIZE + length])
    return Mailbox(protocol, payload, kind >> 4 & 7, address, channel >> 6, channel & 0x3F)


def next_counter(counter: int) -> int:
    """Return the counter that follows `counter`: 1 to 7, then 1 again."""
    return counter % 7 + 1


class ErrorCode(IntEnum):
    """Error code of a mailbox error reply."""

    SYNTAX = 1
    UNSUPPORTED_PROTOCOL = 2
    INVALID_CHANNEL = 3
    SERVICE_NOT_SUPPORTED = 4
    INVALID_HEADER = 5
    SIZE_TOO_SHORT = 6
    NO_MORE_MEMORY = 7
    INVALID_SIZE = 8
    SERVICE_IN_WORK = 9


ERROR_TEXTS = {
    ErrorCode.SYNTAX: "the syntax of the 6-byte mailbox header is wrong",
    ErrorCode.UNSUPPORTED_PROTOCOL: "the protocol is not supported",
    ErrorCode.INVALID_CHANNEL: "the channel field has an invalid value",
    ErrorCode.SERVICE_NOT_SUPPORTED: "the service is not supported",
    ErrorCode.INVALID_HEADER: "the header of the protocol is wrong",
    ErrorCode.SIZE_TOO_SHORT: "the message is too short",
    ErrorCode.NO_MORE_MEMORY: "the device has no memory left for the message",
    ErrorCode.INVALID_SIZE: "the length does not match the data",
    ErrorCode.SERVICE_IN_WORK: "the service is already in use",
}


@dataclass(frozen=True, slots=True)
class ErrorReply:
    """Data of a message of type ERROR. `code` may be a value that the standard does not define."""

    code: int

    @property
    def text(self) -> str:
        """Meaning of the code."""
        known = {int(code): text for code, text in ERROR_TEXTS.items()}
        return known.get(self.code, f"unknown mailbox error 0x{self.code:04X}")

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if the code does not fit."""
        if not 0 <= self.code <= 0xFFFF:
            raise ValueError(f"mailbox error: code {self.code} does not fit into 16 bits")
        return _ERROR.pack(_ERROR_TYPE, self.code)


def decode_error(data: bytes) -> ErrorReply:
    """Decode the data of a message of type ERROR."""
    if len(data) < _ERROR.size:
        raise DecodeError(f"mailbox error: needs {_ERROR.size} bytes, received {len(data)}")
    kind, code = _ERROR.unpack_from(data)
    if kind != _ERROR_TYPE:
        raise DecodeError(f"mailbox error: type {kind} instead of {_ERROR_TYPE}")
    return ErrorReply(code)

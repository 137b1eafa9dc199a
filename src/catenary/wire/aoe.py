"""ADS over EtherCAT (AoE), ETG.1020: the header of a message (AMS), and fragments.

The header has 32 bytes. The data of the service follows (wire/ads.py):

    target NetId, port | source NetId, port | command | state flags | length | error | invoke ID

A message that exceeds the mailbox is sent in fragments. All fragments have the addresses of the
message, the command `FRAGMENT`, and the fragment and packet number instead of the invoke ID. Their
data, joined, are the message from its command on. SSC: ecataoe.c, AmsFragRes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import NamedTuple, TypeAlias

from catenary.errors import DecodeError

HEADER_SIZE = 32
ADDRESSES_SIZE = 16  # of the target and the source
REST_SIZE = HEADER_SIZE - ADDRESSES_SIZE
FRAGMENTS_MAX = 1 << 16  # their numbers have 16 bits
_HEADER = struct.Struct("<6sH6sHHHIII")
_REST = struct.Struct("<HHIII")  # of the header after the addresses


class Command(IntEnum):
    """Service of a message. Devices may use further values."""

    READ_DEVICE_INFO = 1
    READ = 2
    WRITE = 3
    READ_STATE = 4
    WRITE_CONTROL = 5
    ADD_NOTIFICATION = 6
    DELETE_NOTIFICATION = 7
    NOTIFICATION = 8
    READ_WRITE = 9
    FRAGMENT = 0x902


class Flag(IntFlag):
    """State flags of a message."""

    RESPONSE = 0x0001
    NO_RETURN = 0x0002  # the sender expects no response
    ADS_COMMAND = 0x0004


class Address(NamedTuple):
    """Source or target of a message: the NetId, 6 bytes, and the port."""

    net_id: bytes
    port: int

    def __str__(self) -> str:
        return f"{net_id_text(self.net_id)}:{self.port}"


def net_id_of(text: str) -> bytes:
    """Return the bytes of a NetId such as "127.0.0.1.16.1". Raises ValueError if it is invalid."""
    parts = text.split(".")
    if len(parts) != 6 or not all(part.isascii() and part.isdigit() for part in parts):
        raise ValueError(f"{text!r} is not a NetId: six numbers are needed, such as 127.0.0.1.16.1")
    numbers = [int(part) for part in parts]
    if max(numbers) > 255:
        raise ValueError(f"{text!r} is not a NetId: each number is 0 to 255")
    return bytes(numbers)


def net_id_text(net_id: bytes) -> str:
    """Return a NetId as text, such as "127.0.0.1.16.1"."""
    return ".".join(str(byte) for byte in net_id)


@dataclass(frozen=True, slots=True)
class Message:
    """One AoE message: a request, a response or a notification."""

    target: Address
    source: Address
    command: int
    data: bytes = b""
    invoke_id: int = 0
    flags: int = Flag.ADS_COMMAND
    error: int = 0  # of the transport, in a response

    @property
    def is_response(self) -> bool:
        """True if this message answers a request."""
        return bool(self.flags & Flag.RESPONSE)

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        numbers = (self.command, self.flags, len(self.data), self.error, self.invoke_id)
        return _head(self.target, self.source, _rest(*numbers)) + self.data

    def answered(self, data: bytes, error: int = 0) -> Message:
        """Return the response to this request."""
        flags = self.flags | Flag.RESPONSE
        return Message(self.source, self.target, self.command, data, self.invoke_id, flags, error)


@dataclass(frozen=True, slots=True)
class Fragment:
    """Part of a message that exceeds the mailbox."""

    target: Address
    source: Address
    packet: int  # the same in all fragments of a message
    number: int  # 0 is the first fragment
    data: bytes = b""
    flags: int = Flag.NO_RETURN
    error: int = 0

    @property
    def is_response(self) -> bool:
        """True if this message acknowledges a fragment."""
        return bool(self.flags & Flag.RESPONSE)

    @property
    def is_answer(self) -> bool:
        """True if this fragment is part of a response to a request; only the first one tells it."""
        if self.number or len(self.data) < REST_SIZE:
            return False
        return bool(_REST.unpack_from(self.data)[1] & Flag.RESPONSE)

    @property
    def invoke_id(self) -> int:
        """Invoke ID of the whole message; only the first fragment contains it."""
        if self.number or len(self.data) < REST_SIZE:
            return -1
        found: int = _REST.unpack_from(self.data)[4]
        return found

    @property
    def total(self) -> int:
        """Length of the data of all fragments [bytes]; only the first fragment contains it."""
        if self.number or len(self.data) < REST_SIZE:
            raise DecodeError(
                f"AoE: the first fragment has {len(self.data)} bytes; at least {REST_SIZE} needed"
            )
        length: int = _REST.unpack_from(self.data)[2]
        return REST_SIZE + length

    def encode(self) -> bytes:
        """Return the encoded bytes. Raises ValueError if a field does not fit."""
        if not (0 <= self.number <= 0xFFFF and 0 <= self.packet <= 0xFFFF):
            raise ValueError(f"AoE: fragment {self.number} of packet {self.packet} has no 16 bits")
        invoke_id = self.number | self.packet << 16
        rest = _rest(Command.FRAGMENT, self.flags, len(self.data), self.error, invoke_id)
        return _head(self.target, self.source, rest) + self.data

    def acknowledge(self) -> Fragment:
        """Return the acknowledgement of this fragment."""
        flags = self.flags | Flag.RESPONSE
        return Fragment(self.source, self.target, self.packet, self.number, b"", flags)


AoeMessage: TypeAlias = Message | Fragment


def _rest(command: int, flags: int, length: int, error: int, invoke_id: int) -> bytes:
    try:
        return _REST.pack(command, flags, length, error, invoke_id)
    except struct.error as cause:
        raise ValueError(f"AoE: a field of command {command} does not fit: {cause}") from None


def _head(target: Address, source: Address, rest: bytes) -> bytes:
    for address in (target, source):
        if len(address.net_id) != 6 or not 0 <= address.port <= 0xFFFF:
            raise ValueError(f"AoE: {address} is not an address: 6 bytes and a port of 16 bits")
    ports = (target.port.to_bytes(2, "little"), source.port.to_bytes(2, "little"))
    return target.net_id + ports[0] + source.net_id + ports[1] + rest


def decode_aoe(data: bytes) -> AoeMessage:
    """Decode the data of a mailbox message of type AOE. Bytes after its length are ignored."""
    if len(data) < HEADER_SIZE:
        raise DecodeError(f"AoE: needs {HEADER_SIZE} bytes, received {len(data)}")
    to_id, to_port, from_id, from_port, command, flags, length, error, invoke_id = (
        _HEADER.unpack_from(data)
    )
    if HEADER_SIZE + length > len(data):
        raise DecodeError(
            f"AoE: the header announces {length} bytes, {len(data) - HEADER_SIZE} received"
        )
    target, source = Address(to_id, to_port), Address(from_id, from_port)
    rest = bytes(data[HEADER_SIZE : HEADER_SIZE + length])
    if command == Command.FRAGMENT:
        packet, number = invoke_id >> 16, invoke_id & 0xFFFF
        return Fragment(target, source, packet, number, rest, flags, error)
    return Message(target, source, command, rest, invoke_id, flags, error)


def fragments(message: Message, size: int, packet: int) -> Iterator[Fragment]:
    """Yield the fragments of a message.

    Args:
        message: The message.
        size: Longest data of a mailbox message [bytes].
        packet: Packet number of the fragments.
    """
    rest, room = message.encode()[ADDRESSES_SIZE:], size - HEADER_SIZE
    if room < REST_SIZE:
        raise ValueError(f"AoE: a mailbox with {size} bytes of data is too small for fragments")
    if len(rest) > room * FRAGMENTS_MAX:
        raise ValueError(f"AoE: {len(rest)} bytes do not fit into {FRAGMENTS_MAX} fragments")
    for number, start in enumerate(range(0, len(rest), room)):
        part = rest[start : start + room]
        yield Fragment(message.target, message.source, packet, number, part)


def join(first: Fragment, parts: bytes) -> Message:
    """Return the message of joined fragments. Raises DecodeError if it is invalid.

    Args:
        first: The first fragment.
        parts: Data of all fragments.
    """
    found = decode_aoe(_head(first.target, first.source, parts))
    if isinstance(found, Fragment):
        raise DecodeError("AoE: fragments contain another fragment")
    return found

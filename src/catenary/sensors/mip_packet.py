"""Packets of MicroStrain's MIP protocol: framing, checksum, and search in a stream of bytes.

0      2 bytes  0x75 0x65
2      u8       descriptor set: 0x01 to 0x7F commands, 0x80 and above data
3      u8       bytes of the fields
4      fields   each: u8 length with these two bytes, u8 descriptor, data (big endian)
4 + n  2 bytes  Fletcher checksum of all bytes before it

Sources: MicroStrain's data communications protocol manual, document 8500-0064, section 2.1, and
github.com/LORD-MicroStrain/mip_sdk (docs/mip_parser.md, src/c/mip/mip_packet.c).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from catenary.errors import DecodeError
from catenary.sensors.sensor import Counters

SYNC = b"\x75\x65"
HEADER_SIZE = 4
CHECKSUM_SIZE = 2
FIELD_HEADER_SIZE = 2
PAYLOAD_MAX = 255  # bytes of the fields of a packet
# The rest of a packet must follow within this time. It is the default of MicroStrain's parser
# (MIP_PARSER_DEFAULT_TIMEOUT_MS): a damaged length must not hide the packets after it.
REST_NS = 100_000_000


class Field(NamedTuple):
    """One field of a packet."""

    descriptor: int
    data: bytes


class Packet(NamedTuple):
    """Fields with one descriptor set."""

    descriptor_set: int
    fields: tuple[Field, ...]


def checksum(data: bytes) -> bytes:
    """Return the Fletcher checksum: the sum of the bytes, and the sum of all partial sums."""
    first = second = 0
    for byte in data:
        first = (first + byte) & 0xFF
        second = (second + first) & 0xFF
    return bytes((first, second))


def encode_packet(descriptor_set: int, fields: Iterable[Field]) -> bytes:
    """Return the bytes of a packet.

    Args:
        descriptor_set: descriptor set of all fields.
        fields: fields in the order of the packet.

    Raises:
        ValueError: The fields are too long for one packet.
    """
    payload = b"".join(
        bytes((FIELD_HEADER_SIZE + len(data), descriptor)) + data for descriptor, data in fields
    )
    if len(payload) > PAYLOAD_MAX:
        raise ValueError(f"the fields have {len(payload)} bytes; a packet has {PAYLOAD_MAX}")
    head = SYNC + bytes((descriptor_set, len(payload))) + payload
    return head + checksum(head)


def decode_packet(data: bytes) -> Packet:
    """Return the packet in `data`. Its checksum must be correct.

    Raises DecodeError if the lengths of the fields do not add up to the length of the packet.
    """
    return Packet(data[2], tuple(split_fields(data[HEADER_SIZE:-CHECKSUM_SIZE])))


def split_fields(payload: bytes) -> Iterator[Field]:
    """Yield the fields of a packet. Raises DecodeError for a length that does not fit."""
    at = 0
    while at < len(payload):
        length = payload[at]
        if length < FIELD_HEADER_SIZE or at + length > len(payload):
            raise DecodeError(f"a MIP field at byte {at} has {length} of {len(payload) - at} bytes")
        yield Field(payload[at + 1], payload[at + FIELD_HEADER_SIZE : at + length])
        at += length


class PacketSearch:
    """Owner of the bytes of a stream that do not form a complete packet yet."""

    def __init__(self, counters: Counters) -> None:
        self._counters = counters
        self._rest = b""
        self._since_ns = 0  # time of reception of the first byte of the rest

    def clear(self) -> None:
        """Discard the rest."""
        self._rest = b""

    def feed(self, data: bytes, received_ns: int) -> Iterator[Packet]:
        """Yield the packets that are complete with `data`, and count all other bytes.

        Args:
            data: next bytes of the stream.
            received_ns: time of their reception.
        """
        is_late = received_ns - self._since_ns > REST_NS
        if self._rest and is_late:
            self._skip(1)
        if not self._rest or is_late:
            self._since_ns = received_ns
        self._rest += data
        while (packet := self._next(received_ns)) is not None:
            yield packet

    def _next(self, received_ns: int) -> Packet | None:
        """Return the next valid packet; None if the rest contains no complete one."""
        while self._align():
            end = HEADER_SIZE + self._rest[3] + CHECKSUM_SIZE
            if len(self._rest) < end:
                return None
            whole = self._rest[:end]
            if checksum(whole[:-CHECKSUM_SIZE]) != whole[-CHECKSUM_SIZE:]:
                self._counters.bad_checksums += 1
                self._skip(1)  # a valid packet may begin inside the damaged one
                continue
            self._rest, self._since_ns = self._rest[end:], received_ns
            try:
                return decode_packet(whole)
            except DecodeError:
                self._counters.bad_messages += 1
        return None

    def _align(self) -> bool:
        """Skip bytes before the next sync bytes. Return True if a header is complete."""
        at = self._rest.find(SYNC)
        if at < 0:
            at = len(self._rest) - self._rest.endswith(SYNC[:1])
        self._skip(at)
        return len(self._rest) >= HEADER_SIZE

    def _skip(self, count: int) -> None:
        self._counters.garbage += count
        self._rest = self._rest[count:]

"""AoE messages of a device, ETG.1020: the header, and fragments in both directions."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace

ADDRESSES = struct.Struct("<6sH6sH")  # target and source
REST = struct.Struct("<HHIII")  # command, flags, length, error, invoke ID
HEADER_SIZE = ADDRESSES.size + REST.size
RESPONSE, NO_RETURN, ADS_COMMAND = 1, 2, 4
FRAGMENT = 0x902
REQUEST_MAX = 1 << 23  # longest request in fragments [bytes]


@dataclass(frozen=True)
class Head:
    """Header of a message."""

    target: bytes
    port: int
    source: bytes
    source_port: int
    command: int
    flags: int
    length: int
    error: int
    invoke_id: int

    def answer(self, **changes: int) -> Head:
        """Return the header of the response."""
        changed = replace(
            self,
            target=self.source,
            port=self.source_port,
            source=self.target,
            source_port=self.port,
            flags=self.flags | RESPONSE,
            error=0,
        )
        return replace(changed, **changes)  # type: ignore[arg-type]

    def encode(self) -> bytes:
        numbers = (self.command, self.flags, self.length, self.error, self.invoke_id)
        addresses = (self.target, self.port, self.source, self.source_port)
        return ADDRESSES.pack(*addresses) + REST.pack(*numbers)


def decode_head(payload: bytes) -> Head:
    addresses = ADDRESSES.unpack_from(payload)
    return Head(*addresses, *REST.unpack_from(payload, ADDRESSES.size))


def fragments(message: bytes, room: int, packet: int, flags: int) -> Iterator[bytes]:
    """Yield the fragments of a message of more than `room` bytes."""
    addresses, rest = message[: ADDRESSES.size], message[ADDRESSES.size :]
    size = room - HEADER_SIZE
    for number, start in enumerate(range(0, len(rest), size)):
        part = rest[start : start + size]
        yield addresses + REST.pack(FRAGMENT, flags, len(part), 0, number | packet << 16) + part


class Assembly:
    """Owner of the fragments of one request."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        self._packet = self._next = -1
        self._parts = bytearray()

    def add(self, head: Head, part: bytes) -> bytes | None:
        """Add a fragment. Return the message if it is complete, else None."""
        packet, number = head.invoke_id >> 16, head.invoke_id & 0xFFFF
        if number == 0:
            self._packet, self._next, self._parts = packet, 0, bytearray()
        if packet != self._packet or number != self._next or not part:
            self.clear()
            return None
        self._parts += part
        self._next += 1
        if len(self._parts) < REST.size:
            return None
        total = REST.size + REST.unpack_from(self._parts)[2]
        if len(self._parts) > total or total > REQUEST_MAX:
            self.clear()
            return None
        if len(self._parts) < total:
            return None
        addresses = ADDRESSES.pack(head.target, head.port, head.source, head.source_port)
        message = addresses + bytes(self._parts)
        self.clear()
        return message

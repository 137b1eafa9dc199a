"""Captures of Ethernet frames in pcapng format (draft-ietf-opsawg-pcapng).

The decoder accepts both byte orders. The encoder writes one interface, with times in ns.

    capture = encode_header("eth0") + b"".join(encode_packet(packet) for packet in packets)
    decode_pcapng(capture).packets == tuple(packets)

Like Wireshark, the decoder omits a truncated last block. A killed program or a full disk can leave
one. `Capture.cut` is the number of its bytes.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from catenary.errors import DecodeError

ETHERNET = 1  # LINKTYPE_ETHERNET

_SECTION = 0x0A0D0D0A  # the same in both byte orders
_MAGIC = 0x1A2B3C4D
_INTERFACE = 1
_OLD_PACKET = 2  # obsolete, but old files contain it
_SIMPLE_PACKET = 3
_STATISTICS = 5
_ENHANCED_PACKET = 6
_MINIMUM_BLOCK = 12
_MAXIMUM_BLOCK = 1 << 24  # Wireshark's limit
_MAXIMUM_INTERFACES = 1 << 12

_OPTION_END = 0
_OPTION_COMMENT = 1
_OPTION_NAME = 2
_OPTION_FLAGS = 2  # of a packet
_OPTION_RECEIVED = 4  # of a statistics block
_OPTION_DROPPED = 5
_OPTION_RESOLUTION = 9
_OPTION_TIME_OFFSET = 14
_MICROSECONDS = 6  # the default resolution
_NANOSECONDS = 9


@dataclass(frozen=True, slots=True)
class Interface:
    """Interface of a capture.

    A tick is 2^-n s if bit 7 of `resolution` is set, else 10^-n s; n is the value of bits 0 to 6.
    """

    name: str = ""
    link_type: int = ETHERNET
    resolution: int = _NANOSECONDS
    time_offset: int = 0  # [s]


class Direction(IntEnum):
    """Direction of a packet, bits 0 and 1 of epb_flags."""

    UNKNOWN = 0
    INBOUND = 1
    OUTBOUND = 2


@dataclass(frozen=True, slots=True)
class Packet:
    """One captured frame."""

    time_ns: int  # since 1970, or since the epoch of the writer
    data: bytes
    comment: str = ""
    interface: int = 0  # index in Capture.interfaces
    original_length: int | None = None  # None if `data` is not truncated
    direction: Direction = Direction.UNKNOWN


@dataclass(frozen=True, slots=True)
class Capture:
    """Content of a capture file, without blocks of other kinds (names, statistics)."""

    interfaces: tuple[Interface, ...]
    packets: tuple[Packet, ...]
    cut: int = 0  # bytes of a truncated block at the end


def encode_header(interface_name: str = "") -> bytes:
    """Return the start of a file: a section header and one interface, with times in ns."""
    section = struct.pack("<IHHq", _MAGIC, 1, 0, -1)
    options = _option(_OPTION_NAME, interface_name.encode()) if interface_name else b""
    options += _option(_OPTION_RESOLUTION, bytes((_NANOSECONDS,))) + _option(_OPTION_END, b"")
    interface = struct.pack("<HHI", ETHERNET, 0, 0) + options
    return _block(_SECTION, section) + _block(_INTERFACE, interface)


def encode_packet(packet: Packet) -> bytes:
    """Return the block of a packet. Raises ValueError if a field is out of range."""
    original = len(packet.data) if packet.original_length is None else packet.original_length
    if not 0 <= packet.time_ns < 1 << 64:
        raise ValueError(f"pcapng: time {packet.time_ns} ns is out of range; use 0 to 2**64 - 1")
    if packet.interface or not len(packet.data) <= original < 1 << 32:
        raise ValueError(
            f"pcapng: interface {packet.interface} is not 0, or original length {original} is out "
            "of range"
        )
    high, low = packet.time_ns >> 32, packet.time_ns & 0xFFFF_FFFF
    body = struct.pack("<IIIII", 0, high, low, len(packet.data), original) + _pad(packet.data)
    if packet.comment:
        body += _option(_OPTION_COMMENT, packet.comment.encode())
    if packet.direction:
        body += _option(_OPTION_FLAGS, struct.pack("<I", packet.direction))
    if packet.comment or packet.direction:
        body += _option(_OPTION_END, b"")
    return _block(_ENHANCED_PACKET, body)


def encode_statistics(time_ns: int, *, received: int, dropped: int) -> bytes:
    """Return the statistics block, the last block of a file.

    Args:
        time_ns: Time of the statistics [ns].
        received: Number of received packets.
        dropped: Number of received packets that the file does not contain.
    """
    body = struct.pack("<III", 0, time_ns >> 32, time_ns & 0xFFFF_FFFF)
    body += _option(_OPTION_RECEIVED, struct.pack("<Q", received))
    body += _option(_OPTION_DROPPED, struct.pack("<Q", dropped)) + _option(_OPTION_END, b"")
    return _block(_STATISTICS, body)


def decode_pcapng(data: bytes) -> Capture:
    """Decode a file. Raises DecodeError if it is not a pcapng file or a block is invalid.

    A truncated last block is omitted.
    """
    packets = PcapngPackets(io.BytesIO(data).read)
    found = tuple(packets)
    return Capture(tuple(packets.interfaces), found, cut=packets.cut)


class PcapngPackets:
    """Owner of the interfaces of a file. It decodes the packets one by one.

    Iterate over it once. It needs memory for one block only.
    """

    def __init__(self, read: Callable[[int], bytes]) -> None:
        """Decode the bytes that `read(size)` returns, which are fewer only at the end."""
        self._read = read
        self._first_interface = 0  # index of the first interface of the current section
        self._dropped: dict[int, int] = {}
        self.interfaces: list[Interface] = []
        self.cut = 0  # bytes of a truncated block at the end

    @property
    def dropped(self) -> int:
        """Number of packets that the recording program dropped, from its statistics."""
        return sum(self._dropped.values())

    def __iter__(self) -> Iterator[Packet]:
        """Yield the packets. Raises DecodeError if a block is invalid."""
        for block in self._blocks():
            if block.kind == _SECTION:
                self._first_interface = len(self.interfaces)
            elif block.kind == _INTERFACE:
                self._add_interface(block)
            elif block.kind in (_ENHANCED_PACKET, _OLD_PACKET):
                yield _decode_enhanced(block, self)
            elif block.kind == _SIMPLE_PACKET:
                yield _decode_simple(block, self)
            elif block.kind == _STATISTICS:
                self._note_statistics(block)

    def interface(self, number: int) -> int:
        """Return the index in the file of an interface of the current section.

        Args:
            number: Index of the interface in the section.

        Raises:
            DecodeError: The file does not describe the interface.
        """
        found = self._first_interface + number
        if found >= len(self.interfaces):
            raise DecodeError(
                f"pcapng: a packet refers to interface {number}, which the file does not describe"
            )
        return found

    def _add_interface(self, block: _Block) -> None:
        if len(self.interfaces) >= _MAXIMUM_INTERFACES:
            raise DecodeError(f"pcapng: more than {_MAXIMUM_INTERFACES} interfaces")
        self.interfaces.append(_decode_interface(block))

    def _note_statistics(self, block: _Block) -> None:
        number = block.unpack("I")[0]
        dropped = _decode_options(block, 12).get(_OPTION_DROPPED, b"")
        if len(dropped) == 8:  # a later block of the interface replaces the number
            self._dropped[self.interface(number)] = struct.unpack(block.order + "Q", dropped)[0]

    def _blocks(self) -> Iterator[_Block]:
        """Yield every complete block.

        Raises DecodeError if a block is invalid, or if the first block is incomplete.
        """
        offset, order = 0, ""
        while head := self._read(_MINIMUM_BLOCK):
            if len(head) < _MINIMUM_BLOCK:
                if offset:
                    self.cut = len(head)
                    return
                raise DecodeError(
                    f"pcapng block: needs {_MINIMUM_BLOCK} bytes, received {len(head)}"
                )
            if head[:4] == b"\x0a\x0d\x0d\x0a":
                order = _byte_order(head[8:12])
            if not order:
                raise DecodeError("pcapng: the file does not begin with a section header")
            kind, length = struct.unpack_from(order + "II", head)
            if length < _MINIMUM_BLOCK or length % 4 or length > _MAXIMUM_BLOCK:
                raise _invalid_length(offset, length)
            data = head + self._read(length - _MINIMUM_BLOCK)
            if len(data) < length:
                if not offset:
                    raise _invalid_length(offset, length)
                self.cut = len(data)
                return
            if struct.unpack_from(order + "I", data, length - 4)[0] != length:
                raise DecodeError(f"pcapng: block at byte {offset} has two different lengths")
            yield _Block(kind, order, data[8:-4])
            offset += length


def _invalid_length(offset: int, length: int) -> DecodeError:
    return DecodeError(f"pcapng: block at byte {offset} has an invalid length of {length} bytes")


class _Block(NamedTuple):
    kind: int
    order: str  # "<" or ">"
    body: bytes

    def unpack(self, layout: str) -> tuple[int, ...]:
        """Return the fields at the start of the body."""
        size = struct.calcsize(self.order + layout)
        if size > len(self.body):
            raise DecodeError(f"pcapng: block {self.kind} has {len(self.body)} bytes, needs {size}")
        return struct.unpack_from(self.order + layout, self.body)


def _byte_order(magic: bytes) -> str:
    for order in ("<", ">"):
        if magic == struct.pack(order + "I", _MAGIC):
            return order
    raise DecodeError(f"pcapng: invalid byte-order magic {magic.hex()}")


def _decode_interface(block: _Block) -> Interface:
    link_type, _, _ = block.unpack("HHI")
    options = _decode_options(block, 8)
    name = options.get(_OPTION_NAME, b"").decode("utf-8", "replace")
    resolution = options.get(_OPTION_RESOLUTION, bytes((_MICROSECONDS,)))
    time_offset = options.get(_OPTION_TIME_OFFSET, bytes(8))
    if len(resolution) != 1 or len(time_offset) != 8:
        raise DecodeError("pcapng: resolution or time offset of an interface has the wrong length")
    return Interface(
        name, link_type, resolution[0], struct.unpack(block.order + "q", time_offset)[0]
    )


def _decode_enhanced(block: _Block, state: PcapngPackets) -> Packet:
    number, high, low, captured, original = block.unpack("IIIII")
    if block.kind == _OLD_PACKET:  # interface and drop count have 16 bits each
        number = block.unpack("H")[0]
    interface = state.interface(number)
    end = 20 + captured
    if end > len(block.body):
        raise DecodeError(
            f"pcapng: a packet specifies {captured} bytes, but its block has {len(block.body) - 20}"
        )
    options = _decode_options(block, end + -end % 4)
    comment = options.get(_OPTION_COMMENT, b"").decode("utf-8", "replace")
    time_ns = _time_ns(high << 32 | low, state.interfaces[interface])
    original_length = original if original != captured else None
    direction = _direction(block, options.get(_OPTION_FLAGS, bytes(4)))
    return Packet(time_ns, block.body[20:end], comment, interface, original_length, direction)


def _direction(block: _Block, flags: bytes) -> Direction:
    if len(flags) != 4:
        raise DecodeError(f"pcapng: the flags of a packet have {len(flags)} bytes instead of 4")
    bits = struct.unpack(block.order + "I", flags)[0] & 3
    return Direction(bits) if bits < 3 else Direction.UNKNOWN


def _decode_simple(block: _Block, state: PcapngPackets) -> Packet:
    (original,) = block.unpack("I")
    data = block.body[4 : 4 + original]
    original_length = original if original != len(data) else None
    return Packet(0, data, "", state.interface(0), original_length)


def _time_ns(ticks: int, interface: Interface) -> int:
    power = interface.resolution & 0x7F
    divisor = 1 << power if interface.resolution & 0x80 else 10**power
    return ticks * 1_000_000_000 // divisor + interface.time_offset * 1_000_000_000


def _decode_options(block: _Block, offset: int) -> dict[int, bytes]:
    options: dict[int, bytes] = {}
    while offset + 4 <= len(block.body):
        code, length = struct.unpack_from(block.order + "HH", block.body, offset)
        if code == _OPTION_END:
            break
        start = offset + 4
        if start + length > len(block.body):
            raise DecodeError(f"pcapng: option {code} of {length} bytes exceeds its block")
        options.setdefault(code, block.body[start : start + length])
        offset = start + length + -length % 4
    return options


def _block(kind: int, body: bytes) -> bytes:
    length = len(body) + _MINIMUM_BLOCK
    return struct.pack("<II", kind, length) + body + struct.pack("<I", length)


def _option(code: int, value: bytes) -> bytes:
    if len(value) > 0xFFFF:
        raise ValueError(f"pcapng: an option can have at most 65535 bytes, got {len(value)}")
    return struct.pack("<HH", code, len(value)) + _pad(value)


def _pad(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)

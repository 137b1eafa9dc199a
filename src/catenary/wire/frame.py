"""EtherCAT frames in Ethernet, ETG.1000.4 §5.1 to §5.3: Ethernet header, EtherCAT header of type 1,
datagrams, padding. The frame check sequence belongs to the network interface.

EtherCAT in UDP (EtherType 0x0800) and VLAN-tagged frames are refused: a raw link to a segment needs
neither.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from catenary.errors import DecodeError
from catenary.wire.datagram import OVERHEAD, Datagram, decode_datagram

ETHERTYPE = 0x88A4
BROADCAST = b"\xff" * 6
DEFAULT_SOURCE = b"\x10\x10\x10\x10\x10\x10"  # locally unassigned, bit 1 of byte 0 clear
ETHERNET_HEADER_SIZE = 14
ETHERCAT_HEADER_SIZE = 2
HEADER_SIZE = ETHERNET_HEADER_SIZE + ETHERCAT_HEADER_SIZE
MINIMUM_SIZE = 60  # without the frame check sequence
MAXIMUM_SIZE = 1514
MAXIMUM_PAYLOAD = MAXIMUM_SIZE - HEADER_SIZE  # all datagrams with their headers
MAXIMUM_DATA = MAXIMUM_PAYLOAD - OVERHEAD  # of a datagram alone in its frame
PASSED_CONTROLLER = 0x02  # set in byte 0 of the source address by the first controller

_TYPE_COMMAND = 1
_FRAME_OVERHEAD = 8 + 4 + 12  # preamble, check sequence, gap
_VLAN_ETHERTYPES = (0x8100, 0x88A8)


def wire_time_ns(size: int) -> int:
    """How long a frame of `size` bytes, without check sequence, holds a cable of 100 Mbit/s [ns]:
    preamble, padding, check sequence and the gap behind it included."""
    return (max(size, MINIMUM_SIZE) + _FRAME_OVERHEAD) * 80


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame. `padding` is what follows the last datagram: encode restores every byte.

    `counted_padding`: how much of it the length in the EtherCAT header counts. None is the rule;
    TwinCAT counts an even number of bytes, others count Ethernet's minimum.
    """

    datagrams: tuple[Datagram, ...]
    source: bytes = DEFAULT_SOURCE
    destination: bytes = BROADCAST
    padding: bytes = b""
    counted_padding: int = 0

    @property
    def has_passed_controller(self) -> bool:
        """Whether a controller processed it: the first one sets a bit of the source address.

        A frame that comes back without it met no device, for instance on `lo`.
        """
        return bool(self.source[0] & PASSED_CONTROLLER)

    @property
    def sender(self) -> bytes:
        """Its source address without the bit that controllers set."""
        return bytes((self.source[0] & ~PASSED_CONTROLLER,)) + self.source[1:]

    def encode(self) -> bytes:
        """Its bytes, without a frame check sequence. ValueError if it is too long or empty."""
        if not self.datagrams:
            raise ValueError("a frame needs at least one datagram")
        if len(self.source) != 6 or len(self.destination) != 6:
            raise ValueError("a MAC address has 6 bytes")
        last = len(self.datagrams) - 1
        payload = b"".join(
            datagram.encode(more_follows=i < last) for i, datagram in enumerate(self.datagrams)
        )
        if len(payload) + len(self.padding) > MAXIMUM_PAYLOAD:
            raise ValueError(
                f"datagrams of {len(payload)} bytes: at most {MAXIMUM_PAYLOAD} a frame"
            )
        if not 0 <= self.counted_padding <= len(self.padding):
            raise ValueError(f"{self.counted_padding} bytes of padding counted, not all are there")
        length = len(payload) + self.counted_padding
        header = struct.pack("<H", length | _TYPE_COMMAND << 12)
        ethertype = struct.pack(">H", ETHERTYPE)
        return self.destination + self.source + ethertype + header + payload + self.padding


def encode_frame(
    datagrams: Sequence[Datagram], *, source: bytes = DEFAULT_SOURCE, destination: bytes = BROADCAST
) -> bytes:
    """The bytes of a frame with these datagrams, padded with zeros to Ethernet's minimum."""
    return Frame(tuple(datagrams), source, destination).encode().ljust(MINIMUM_SIZE, b"\x00")


def decode_frame(data: bytes) -> Frame:
    """The frame in `data`, or DecodeError saying why it is none."""
    if reason := _why_alien(data):
        raise DecodeError(f"no EtherCAT frame: {reason}")
    length = int.from_bytes(data[ETHERNET_HEADER_SIZE:HEADER_SIZE], "little") & 0x07FF
    end = HEADER_SIZE + length
    if end > len(data):
        raise DecodeError(
            f"EtherCAT header says {length} bytes, {len(data) - HEADER_SIZE} received"
        )
    datagrams, rest = _decode_datagrams(bytes(data[:end]))
    return Frame(
        datagrams,
        bytes(data[6:12]),
        bytes(data[0:6]),
        bytes(data[rest:]),
        counted_padding=end - rest,
    )


def is_alien(data: bytes) -> bool:
    """Whether the bytes are no EtherCAT frame of commands at all: other traffic on the cable."""
    return _why_alien(data) is not None


def is_own(data: bytes, source: bytes) -> bool:
    """Whether a frame was sent from the MAC address `source`, passed through controllers or not."""
    mask = 0xFF & ~PASSED_CONTROLLER
    return len(data) >= 12 and data[6] & mask == source[0] & mask and data[7:12] == source[1:]


def _why_alien(data: bytes) -> str | None:
    if len(data) < HEADER_SIZE + OVERHEAD:
        return f"{len(data)} bytes, needs {HEADER_SIZE + OVERHEAD}"
    if len(data) > MAXIMUM_SIZE:
        return f"{len(data)} bytes, at most {MAXIMUM_SIZE}"
    ethertype = int.from_bytes(data[12:14], "big")
    if ethertype in _VLAN_ETHERTYPES:
        return f"VLAN-tagged (EtherType 0x{ethertype:04X}); a segment takes untagged frames"
    if ethertype != ETHERTYPE:
        return f"EtherType 0x{ethertype:04X}, needs 0x{ETHERTYPE:04X}"
    header = int.from_bytes(data[ETHERNET_HEADER_SIZE:HEADER_SIZE], "little")
    if header >> 12 != _TYPE_COMMAND:
        return f"EtherCAT header of type {header >> 12}, needs {_TYPE_COMMAND} (commands)"
    if header & 0x0800:
        return "reserved bit 11 of the EtherCAT header is set"
    return None


def _decode_datagrams(data: bytes) -> tuple[tuple[Datagram, ...], int]:
    """The datagrams, and where the last one ends."""
    datagrams: list[Datagram] = []
    offset, more_follows = HEADER_SIZE, True
    while more_follows:
        datagram, more_follows = decode_datagram(data, offset)
        datagrams.append(datagram)
        offset += datagram.size
    return tuple(datagrams), offset

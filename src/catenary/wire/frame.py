"""EtherCAT frames in Ethernet, ETG.1000.4 §5.1 to §5.3.

A frame consists of an Ethernet header, an EtherCAT header of type 1, datagrams and padding. The
network interface adds and checks the frame check sequence.

EtherCAT over UDP (EtherType 0x0800) and VLAN-tagged frames are rejected: a direct link to a segment
does not need them.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from catenary.errors import DecodeError
from catenary.wire.datagram import OVERHEAD, Datagram, decode_datagram

ETHERTYPE = 0x88A4
BROADCAST = b"\xff" * 6
DEFAULT_SOURCE = b"\x10\x10\x10\x10\x10\x10"  # bit 1 of byte 0, which controllers set, is clear
ETHERNET_HEADER_SIZE = 14
ETHERCAT_HEADER_SIZE = 2
HEADER_SIZE = ETHERNET_HEADER_SIZE + ETHERCAT_HEADER_SIZE
MINIMUM_SIZE = 60  # without the frame check sequence
MAXIMUM_SIZE = 1514
MAXIMUM_PAYLOAD = MAXIMUM_SIZE - HEADER_SIZE  # all datagrams including their headers
MAXIMUM_DATA = MAXIMUM_PAYLOAD - OVERHEAD  # of a single datagram in a frame
PASSED_CONTROLLER = 0x02  # set in byte 0 of the source address by the first controller

_TYPE_COMMAND = 1
_FRAME_OVERHEAD = 8 + 4 + 12  # preamble, check sequence, gap
_VLAN_ETHERTYPES = (0x8100, 0x88A8)


def wire_time_ns(size: int) -> int:
    """Return the time [ns] that a frame occupies a cable of 100 Mbit/s.

    The time includes preamble, padding, check sequence and inter-frame gap; `size` [bytes] does
    not include them.
    """
    return (max(size, MINIMUM_SIZE) + _FRAME_OVERHEAD) * 80


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame. `padding` contains the bytes after the last datagram; `encode` restores them.

    `counted_padding` is the part of the padding that the length in the EtherCAT header includes. It
    is usually 0. TwinCAT includes the padding to an even length. Some masters include all of it.
    """

    datagrams: tuple[Datagram, ...]
    source: bytes = DEFAULT_SOURCE
    destination: bytes = BROADCAST
    padding: bytes = b""
    counted_padding: int = 0

    @property
    def has_passed_controller(self) -> bool:
        """True if a controller has processed the frame.

        The first controller sets a bit of the source address. A frame that returns without this
        bit did not pass any device, for instance on `lo`.
        """
        return bool(self.source[0] & PASSED_CONTROLLER)

    @property
    def sender(self) -> bytes:
        """Source address without the bit that controllers set."""
        return bytes((self.source[0] & ~PASSED_CONTROLLER,)) + self.source[1:]

    def encode(self) -> bytes:
        """Return the encoded bytes, without a frame check sequence.

        Raises:
            ValueError: The frame is too long or empty, or a field does not fit.
        """
        if not self.datagrams:
            raise ValueError("a frame needs at least one datagram")
        if len(self.source) != 6 or len(self.destination) != 6:
            raise ValueError("source and destination must have 6 bytes (MAC addresses)")
        last = len(self.datagrams) - 1
        payload = b"".join(
            datagram.encode(more_follows=i < last) for i, datagram in enumerate(self.datagrams)
        )
        if len(payload) + len(self.padding) > MAXIMUM_PAYLOAD:
            raise ValueError(
                f"datagrams of {len(payload)} bytes and their padding exceed the {MAXIMUM_PAYLOAD} "
                "bytes of a frame"
            )
        if not 0 <= self.counted_padding <= len(self.padding):
            raise ValueError(
                f"counted_padding must be 0 to {len(self.padding)}, got {self.counted_padding}"
            )
        length = len(payload) + self.counted_padding
        header = struct.pack("<H", length | _TYPE_COMMAND << 12)
        ethertype = struct.pack(">H", ETHERTYPE)
        return self.destination + self.source + ethertype + header + payload + self.padding


def encode_frame(
    datagrams: Sequence[Datagram], *, source: bytes = DEFAULT_SOURCE, destination: bytes = BROADCAST
) -> bytes:
    """Return the bytes of a frame, padded with zeros to Ethernet's minimum.

    Args:
        datagrams: At least one datagram, in order.
        source: Source MAC address.
        destination: Destination MAC address.

    Raises:
        ValueError: The frame is too long or empty, or a field does not fit.
    """
    return Frame(tuple(datagrams), source, destination).encode().ljust(MINIMUM_SIZE, b"\x00")


def decode_frame(data: bytes) -> Frame:
    """Decode a frame. Raises DecodeError if it is not an EtherCAT frame or is invalid."""
    if reason := _why_alien(data):
        raise DecodeError(f"not an EtherCAT frame: {reason}")
    length = int.from_bytes(data[ETHERNET_HEADER_SIZE:HEADER_SIZE], "little") & 0x07FF
    end = HEADER_SIZE + length
    if end > len(data):
        raise DecodeError(
            f"EtherCAT header specifies {length} bytes, but {len(data) - HEADER_SIZE} were received"
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
    """Return True if the bytes are not an EtherCAT command frame."""
    return _why_alien(data) is not None


def is_own(data: bytes, source: bytes) -> bool:
    """Return True if a frame was sent by `source`, even if controllers have processed it.

    Args:
        data: The frame, starting with the destination address.
        source: The MAC address of the sender, 6 bytes.
    """
    mask = 0xFF & ~PASSED_CONTROLLER
    return len(data) >= 12 and data[6] & mask == source[0] & mask and data[7:12] == source[1:]


def _why_alien(data: bytes) -> str | None:
    if len(data) < HEADER_SIZE + OVERHEAD:
        return f"{len(data)} bytes, needs at least {HEADER_SIZE + OVERHEAD}"
    if len(data) > MAXIMUM_SIZE:
        return f"{len(data)} bytes, at most {MAXIMUM_SIZE}"
    ethertype = int.from_bytes(data[12:14], "big")
    if ethertype in _VLAN_ETHERTYPES:
        return f"VLAN-tagged (EtherType 0x{ethertype:04X}); use untagged frames"
    if ethertype != ETHERTYPE:
        return f"EtherType 0x{ethertype:04X} instead of 0x{ETHERTYPE:04X}"
    header = int.from_bytes(data[ETHERNET_HEADER_SIZE:HEADER_SIZE], "little")
    if header >> 12 != _TYPE_COMMAND:
        return f"EtherCAT header of type {header >> 12} instead of {_TYPE_COMMAND} (commands)"
    if header & 0x0800:
        return "reserved bit 11 of the EtherCAT header is set"
    return None


def _decode_datagrams(data: bytes) -> tuple[tuple[Datagram, ...], int]:
    """Return the datagrams, and the offset at which the last one ends."""
    datagrams: list[Datagram] = []
    offset, more_follows = HEADER_SIZE, True
    while more_follows:
        datagram, more_follows = decode_datagram(data, offset)
        datagrams.append(datagram)
        offset += datagram.size
    return tuple(datagrams), offset

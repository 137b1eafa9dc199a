"""Ethernet frames in captured packets: link types, VLAN tags, UDP (ETG.1000.4 §4.3).

`unwrap` returns an EtherCAT frame without tags and without UDP, as `wire.frame` decodes it.
"""

from __future__ import annotations

from typing import NamedTuple

from catenary.wire.frame import ETHERCAT_HEADER_SIZE, ETHERTYPE, MAXIMUM_SIZE
from catenary.wire.pcapng import ETHERNET, Direction, Packet

UDP_PORT = 0x88A4
LINUX_COOKED, LINUX_COOKED_2 = 113, 276
# Bytes in front of the Ethernet frame: Hilscher netANALYZER, the same with preamble, 802.3br
PREFIXES = {ETHERNET: 0, 240: 4, 241: 12, 274: 8}
LINK_TYPES = frozenset((*PREFIXES, LINUX_COOKED, LINUX_COOKED_2))

_ETHERTYPE_BYTES = ETHERTYPE.to_bytes(2, "big")
_VLAN = frozenset((b"\x81\x00", b"\x88\xa8", b"\x91\x00"))
_MAXIMUM_TAGS = 4
_IPV4 = b"\x08\x00"
_IPV4_HEADER_SIZE = 20
_UDP_HEADER_SIZE = 8
_UDP = 17
# Beckhoff's EtherCAT Switch Link (ET2000, CU2508): 16 bytes with time and port before the frame
_SWITCH_LINK = (b"\x01\x01\x05\x10\x00\x00", b"\x01\x01\x05\x11\x00\x00")
_SWITCH_LINK_SIZE = 16
_OUTGOING = 4  # packet type of Linux cooked captures
_UNKNOWN_ADDRESS = bytes(6)


class Unwrapped(NamedTuple):
    """An EtherCAT frame: addresses, EtherType, EtherCAT header and datagrams."""

    frame: bytes
    direction: Direction


def unwrap(packet: Packet, link_type: int) -> Unwrapped | None:
    """Return the EtherCAT frame in a packet; None if the packet has another protocol.

    Args:
        packet: The captured packet.
        link_type: Link type of its interface, one of `LINK_TYPES` for Ethernet.
    """
    data, direction = packet.data, packet.direction
    if link_type == LINUX_COOKED and len(data) >= 16:
        direction = _cooked_direction(data[1], direction)
        data = _UNKNOWN_ADDRESS + data[6:12] + data[14:]
    elif link_type == LINUX_COOKED_2 and len(data) >= 20:
        direction = _cooked_direction(data[10], direction)
        data = _UNKNOWN_ADDRESS + data[12:18] + data[0:2] + data[20:]
    elif link_type in PREFIXES:
        data = data[PREFIXES[link_type] :]
    else:
        return None
    if data[:6] in _SWITCH_LINK:
        data = data[_SWITCH_LINK_SIZE:]
    if data[12:14] != _ETHERTYPE_BYTES:
        data = _without_tags(data)
    if data[12:14] == _IPV4:
        data = _without_udp(data)
    if data[12:14] != _ETHERTYPE_BYTES:
        return None
    return Unwrapped(data if len(data) <= MAXIMUM_SIZE else _without_trailer(data), direction)


def _cooked_direction(packet_type: int, stored: Direction) -> Direction:
    if stored is not Direction.UNKNOWN:
        return stored
    return Direction.OUTBOUND if packet_type == _OUTGOING else Direction.INBOUND


def _without_tags(data: bytes) -> bytes:
    for _ in range(_MAXIMUM_TAGS):
        if data[12:14] not in _VLAN:
            break
        data = data[:12] + data[16:]
    return data


def _without_udp(data: bytes) -> bytes:
    """Return the frame with the EtherCAT header directly after the EtherType."""
    header = 4 * (data[14] & 0x0F) if len(data) > 14 else 0
    udp = 14 + header
    if header < _IPV4_HEADER_SIZE or len(data) < udp + _UDP_HEADER_SIZE or data[23] != _UDP:
        return data
    ports = (data[udp : udp + 2], data[udp + 2 : udp + 4])
    if _ETHERTYPE_BYTES not in ports:  # the port has the number of the EtherType
        return data
    return data[:12] + _ETHERTYPE_BYTES + data[udp + _UDP_HEADER_SIZE :]


def _without_trailer(data: bytes) -> bytes:
    """Return the frame without a frame check sequence or other bytes after the datagrams."""
    length = int.from_bytes(data[14:16], "little") & 0x07FF
    return data[: 14 + ETHERCAT_HEADER_SIZE + length]

"""Captures of Ethernet frames in the pcap format of `tcpdump -w` (draft-ietf-opsawg-pcap).

The decoder accepts both byte orders, and time stamps in microseconds or nanoseconds. It omits a
truncated last record; `Capture.cut` is the number of its bytes.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from catenary.errors import DecodeError
from catenary.wire.pcapng import Capture, Interface, Packet

_HEADER = "IHHiIII"  # magic, version, time zone, accuracy, snap length, link type
_RECORD = "IIII"  # seconds, fraction, bytes captured, bytes on the wire
_HEADER_SIZE, _RECORD_SIZE = 24, 16
_UNITS = {0xA1B2C3D4: (1000, 6), 0xA1B23C4D: (1, 9)}  # magic: (ns per tick, decimal exponent)
_LINK_TYPE = 0xFFFF  # mask; the upper half describes the frame check sequence


class _Format(NamedTuple):
    order: str  # "<" or ">"
    tick_ns: int
    resolution: int


def is_pcap(data: bytes) -> bool:
    """Return True if the bytes begin with a pcap magic number."""
    return _format(data) is not None


def decode_pcap(data: bytes) -> Capture:
    """Decode a file. Raises DecodeError if it is not a pcap file or its header is truncated."""
    form = _format(data)
    if form is None:
        raise DecodeError(f"not a pcap file: magic number {data[:4].hex() or 'missing'}")
    if len(data) < _HEADER_SIZE:
        raise DecodeError(f"pcap header: needs {_HEADER_SIZE} bytes, received {len(data)}")
    link_type = struct.unpack_from(form.order + _HEADER, data)[-1] & _LINK_TYPE
    packets: list[Packet] = []
    offset = _HEADER_SIZE
    while offset + _RECORD_SIZE <= len(data):
        seconds, ticks, size, original = struct.unpack_from(form.order + _RECORD, data, offset)
        end = offset + _RECORD_SIZE + size
        if end > len(data):
            break
        packets.append(
            Packet(
                seconds * 1_000_000_000 + ticks * form.tick_ns,
                data[offset + _RECORD_SIZE : end],
                original_length=original if original != size else None,
            )
        )
        offset = end
    interface = Interface(link_type=link_type, resolution=form.resolution)
    return Capture((interface,), tuple(packets), cut=len(data) - offset)


def _format(data: bytes) -> _Format | None:
    for order in ("<", ">"):
        for magic, (tick_ns, resolution) in _UNITS.items():
            if data[:4] == struct.pack(order + "I", magic):
                return _Format(order, tick_ns, resolution)
    return None

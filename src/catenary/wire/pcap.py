"""Captures of Ethernet frames in the pcap format of `tcpdump -w` (draft-ietf-opsawg-pcap).

The decoder accepts both byte orders, and time stamps in microseconds or nanoseconds. It omits a
truncated last record; `Capture.cut` is the number of its bytes.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

from catenary.errors import DecodeError
from catenary.wire.pcapng import Capture, Interface, Packet

_HEADER = "IHHiIII"  # magic, version, time zone, accuracy, snap length, link type
_RECORD = "IIII"  # seconds, fraction, bytes captured, bytes on the wire
_HEADER_SIZE, _RECORD_SIZE = 24, 16
_UNITS = {0xA1B2C3D4: (1000, 6), 0xA1B23C4D: (1, 9)}  # magic: (ns per tick, decimal exponent)
_MAXIMUM_RECORD = 1 << 24  # longer ones are damaged: the longest snap length is 256 KiB
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
    packets = PcapPackets(io.BytesIO(data).read)
    found = tuple(packets)
    return Capture(tuple(packets.interfaces), found, cut=packets.cut)


class PcapPackets:
    """Owner of the header of a file. It decodes the packets one by one.

    Iterate over it once. It needs memory for one packet only.
    """

    def __init__(self, read: Callable[[int], bytes]) -> None:
        """Decode the bytes that `read(size)` returns, which are fewer only at the end."""
        self._read = read
        self.interfaces: list[Interface] = []
        self.cut = 0  # bytes of a truncated record at the end
        self.dropped = 0  # the format has no statistics

    def __iter__(self) -> Iterator[Packet]:
        """Yield the packets.

        Raises:
            DecodeError: It is not a pcap file, its header is truncated, or a record is too long.
        """
        form = self._read_header()
        offset = _HEADER_SIZE
        while head := self._read(_RECORD_SIZE):
            if len(head) < _RECORD_SIZE:
                self.cut = len(head)
                return
            seconds, ticks, size, original = struct.unpack(form.order + _RECORD, head)
            if size > _MAXIMUM_RECORD:
                raise DecodeError(f"pcap: record at byte {offset} has a length of {size} bytes")
            data = self._read(size)
            if len(data) < size:
                self.cut = _RECORD_SIZE + len(data)
                return
            time_ns = seconds * 1_000_000_000 + ticks * form.tick_ns
            yield Packet(time_ns, data, original_length=original if original != size else None)
            offset += _RECORD_SIZE + size

    def _read_header(self) -> _Format:
        data = self._read(_HEADER_SIZE)
        form = _format(data)
        if form is None:
            raise DecodeError(f"not a pcap file: magic number {data[:4].hex() or 'missing'}")
        if len(data) < _HEADER_SIZE:
            raise DecodeError(f"pcap header: needs {_HEADER_SIZE} bytes, received {len(data)}")
        link_type = struct.unpack_from(form.order + _HEADER, data)[-1] & _LINK_TYPE
        self.interfaces.append(Interface(link_type=link_type, resolution=form.resolution))
        return form


def _format(data: bytes) -> _Format | None:
    for order in ("<", ">"):
        for magic, (tick_ns, resolution) in _UNITS.items():
            if data[:4] == struct.pack(order + "I", magic):
                return _Format(order, tick_ns, resolution)
    return None

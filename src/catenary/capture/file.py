"""EtherCAT frames of a capture file, read as a stream in constant memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from catenary.capture.direction import CapturedFrame
from catenary.capture.envelope import LINK_TYPES, unwrap
from catenary.errors import DecodeError
from catenary.wire.capture import open_packets
from catenary.wire.frame import decode_frame
from catenary.wire.pcapng import Packet

_COMMANDS = 1  # type of an EtherCAT header with datagrams


@dataclass(slots=True)
class FileCounts:
    """Owner of the numbers of packets in a file, which grow while it is read."""

    packets: int = 0
    ethercat: int = 0  # frames with datagrams
    other: int = 0  # packets of other protocols
    unsupported: int = 0  # packets of link types that carry no Ethernet
    shortened: int = 0  # EtherCAT frames of which the file contains only the start
    malformed: int = 0
    first_malformed: str = ""  # number of the packet and the reason
    dropped: int = 0  # packets that the recording program dropped
    cut: int = 0  # bytes of a truncated packet at the end of the file
    damaged: str = ""  # reason why the rest of the file cannot be read
    duration_ns: int = 0


class CaptureFile:
    """Owner of a capture while it is read: the time of its first packet, and the counts.

    Iterate over it once. Times are relative to the first packet of the file.
    """

    def __init__(self, read: Callable[[int], bytes], *, until_ns: int | None = None) -> None:
        """Read a file.

        Args:
            read: `read(size)` returns the next bytes, fewer only at the end of the file.
            until_ns: Stop at the first packet after this time since the first packet.

        Raises:
            DecodeError: The format is unknown.
        """
        self._until_ns = until_ns
        self._packets = open_packets(read)
        self._start_ns: int | None = None
        self.counts = FileCounts()

    @property
    def start_ns(self) -> int | None:
        """Time of the first packet since 1970 [ns]; None before it was read."""
        return self._start_ns

    def __iter__(self) -> Iterator[CapturedFrame]:
        """Yield the EtherCAT frames. A damaged file ends with a reason in `counts.damaged`.

        Raises:
            DecodeError: The file is damaged before its first packet.
        """
        counts = self.counts
        try:
            for packet in self._packets:
                if self._start_ns is None:
                    self._start_ns = packet.time_ns
                if self._until_ns is not None and packet.time_ns - self._start_ns > self._until_ns:
                    break
                counts.packets += 1
                counts.duration_ns = max(counts.duration_ns, packet.time_ns - self._start_ns)
                frame = self._decode(packet)
                if frame is not None:
                    counts.ethercat += 1
                    yield frame
        except DecodeError as error:
            if not counts.packets:
                raise
            counts.damaged = f"after packet {counts.packets}: {error.message}"
        counts.cut = self._packets.cut
        counts.dropped = self._packets.dropped

    def _decode(self, packet: Packet) -> CapturedFrame | None:
        counts = self.counts
        link_type = self._packets.interfaces[packet.interface].link_type
        found = unwrap(packet, link_type)
        if found is None or _header_type(found.frame) not in (_COMMANDS, None):
            counts.unsupported += link_type not in LINK_TYPES
            counts.other += link_type in LINK_TYPES
            return None
        try:
            frame = decode_frame(found.frame)
        except DecodeError as error:
            if packet.original_length is not None:
                counts.shortened += 1
            else:
                counts.malformed += 1
                counts.first_malformed = (
                    counts.first_malformed or f"packet {counts.packets}: {error.message}"
                )
            return None
        time_ns = packet.time_ns - (self._start_ns or 0)
        return CapturedFrame(counts.packets, time_ns, frame, len(found.frame), found.direction)


def _header_type(frame: bytes) -> int | None:
    """Return the type in the EtherCAT header; None if the frame is too short."""
    return frame[15] >> 4 if len(frame) > 15 else None

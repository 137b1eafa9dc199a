"""Captures in all supported formats: pcapng (wire/pcapng.py) and pcap (wire/pcap.py)."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TypeAlias

from catenary.errors import DecodeError
from catenary.wire.pcap import PcapPackets, is_pcap
from catenary.wire.pcapng import Capture, PcapngPackets

Packets: TypeAlias = PcapPackets | PcapngPackets

_START_SIZE = 12
_PCAPNG = b"\x0a\x0d\x0d\x0a"
_HINT = "use a capture in pcapng or pcap format, from Wireshark or tcpdump -w"
_COMPRESSED = {b"\x1f\x8b": "gunzip", b"\x28\xb5": "unzstd", b"BZ": "bunzip2", b"PK": "unzip"}


def decode_capture(data: bytes) -> Capture:
    """Decode a file. Raises DecodeError if the format is unknown or the content is invalid.

    A truncated last packet is omitted.
    """
    packets = open_packets(io.BytesIO(data).read)
    try:
        found = tuple(packets)
    except DecodeError as error:
        error.hint = error.hint or _HINT
        raise
    return Capture(tuple(packets.interfaces), found, cut=packets.cut)


def open_packets(read: Callable[[int], bytes]) -> Packets:
    """Return the packets of a file, which are decoded one by one during an iteration.

    Args:
        read: `read(size)` returns the next bytes of the file, fewer only at its end.

    Raises:
        DecodeError: The format is unknown.
    """
    start = read(_START_SIZE)
    rest = _after(start, read)
    if is_pcap(start):
        return PcapPackets(rest)
    if start[:4] != _PCAPNG:
        tool = _COMPRESSED.get(start[:2])
        raise DecodeError(
            f"not a pcapng or pcap file: it begins with {start[:4].hex() or 'nothing'}",
            hint=f"decompress the file first: {tool} FILE" if tool else _HINT,
        )
    return PcapngPackets(rest)


def _after(start: bytes, read: Callable[[int], bytes]) -> Callable[[int], bytes]:
    """Return a function that reads `start` again, then the rest."""
    held = start

    def read_on(size: int) -> bytes:
        nonlocal held
        if not held:
            return read(size)
        data, held = held[:size], held[size:]
        return data + read(size - len(data)) if size > len(data) else data

    return read_on

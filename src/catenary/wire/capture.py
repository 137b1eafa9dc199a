"""Captures in all supported formats: pcapng (wire/pcapng.py) and pcap (wire/pcap.py)."""

from __future__ import annotations

from catenary.errors import DecodeError
from catenary.wire.pcap import decode_pcap, is_pcap
from catenary.wire.pcapng import Capture, decode_pcapng


def decode_capture(data: bytes) -> Capture:
    """Decode a file. Raises DecodeError if the format is unknown or the content is invalid.

    A truncated last packet is omitted.
    """
    if is_pcap(data):
        return decode_pcap(data)
    try:
        return decode_pcapng(data)
    except DecodeError as error:
        error.hint = (
            error.hint or "use a capture in pcapng or pcap format, from Wireshark or tcpdump -w"
        )
        raise

"""Captures in any format that is read: pcapng (wire/pcapng.py) and pcap (wire/pcap.py)."""

from __future__ import annotations

from catenary.errors import DecodeError
from catenary.wire.pcap import decode_pcap, is_pcap
from catenary.wire.pcapng import Capture, decode_pcapng


def decode_capture(data: bytes) -> Capture:
    """Return the capture in a file's bytes, up to the cut. Raises DecodeError if it is not one."""
    if is_pcap(data):
        return decode_pcap(data)
    try:
        return decode_pcapng(data)
    except DecodeError as error:
        error.hint = error.hint or "captures are read in pcapng and pcap: Wireshark, tcpdump -w"
        raise

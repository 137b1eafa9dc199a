"""Checksum of IPv4, ICMP and TCP, RFC 1071."""

from __future__ import annotations

LARGEST = 0xFFFF


def checksum(data: bytes) -> int:
    """Return the checksum; 0 for data that contains its correct checksum."""
    if len(data) % 2:
        data += b"\0"
    # The sum of 16-bit words with end-around carry is the remainder by 2**16 - 1. A loop over the
    # words takes six times as long. It would delay the frames of the whole segment.
    number = int.from_bytes(data, "big")
    total = number % LARGEST
    return LARGEST - (total or (LARGEST if number else 0))

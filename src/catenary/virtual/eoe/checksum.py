"""Checksum of IPv4, ICMP and TCP, RFC 1071."""

from __future__ import annotations

import struct


def checksum(data: bytes) -> int:
    """Return the checksum; 0 for data that contains its correct checksum."""
    if len(data) % 2:
        data += b"\0"
    total: int = sum(struct.unpack(f"!{len(data) // 2}H", data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF

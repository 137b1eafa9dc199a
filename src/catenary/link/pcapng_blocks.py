"""The blocks round the packets of a recording (pcapng, draft-ietf-opsawg-pcapng §4)."""

from __future__ import annotations

import struct

LINKTYPE_ETHERNET = 1
NANOSECONDS = 9  # if_tsresol: stamps count 10 ** -9 s


def block(kind: int, body: bytes) -> bytes:
    length = len(body) + 12
    return struct.pack("<II", kind, length) + body + struct.pack("<I", length)


def option(code: int, value: bytes) -> bytes:
    padding = bytes(-len(value) % 4)
    return struct.pack("<HH", code, len(value)) + value + padding


def opening_blocks(interface_name: str) -> bytes:
    """Section Header and Interface Description."""
    section = struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)
    interface = struct.pack("<HHI", LINKTYPE_ETHERNET, 0, 0)
    options = option(2, interface_name.encode()) + option(9, bytes([NANOSECONDS])) + option(0, b"")
    return block(0x0A0D0D0A, section) + block(1, interface + options)


def closing_block(stamp_ns: int, recorded: int, dropped: int) -> bytes:
    """Interface Statistics: isb_ifrecv (4) frames seen, isb_ifdrop (5) frames not recorded."""
    seen = option(4, struct.pack("<Q", recorded + dropped))
    options = seen + option(5, struct.pack("<Q", dropped)) + option(0, b"")
    return block(5, struct.pack("<III", 0, stamp_ns >> 32, stamp_ns & 0xFFFFFFFF) + options)

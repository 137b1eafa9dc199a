"""Ethernet port of a virtual device, and its differences from the standard.

In TOML: `ethernet = { ip = "192.168.7.2", pages = { "/" = "<h1>Drive</h1>" } }`.
"""

from __future__ import annotations

from collections.abc import Mapping
from ipaddress import IPv4Address
from typing import Literal

import msgspec

PAGE = "<!doctype html><title>Virtual device</title><h1>Virtual device</h1><p>It works.</p>\n"
FLOOD_MAX = 10_000.0  # [frames/s]


class EthernetOptions(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Addresses, pages and faults of the Ethernet port of a virtual device."""

    ip: str = "192.168.7.2"
    mask: str = "255.255.255.0"
    gateway: str = ""  # empty: none
    dns: str = ""
    mac: str = "02:00:00:00:07:02"
    name: str = "virtual"
    pages: Mapping[str, str] = {}  # by path; none: PAGE

    # Answer to requests for addresses. "packed": without gaps for absent fields (SOES, esc_eoe.c).
    # "refused": result 0x0201. "silent": none.
    addresses: Literal["answered", "packed", "refused", "silent"] = "answered"

    # Fault of the fragments of every `faulty_every`-th frame. "lost": the second is missing.
    # "longer": the first announces one block only. "endless": none is the last.
    fragments: Literal["right", "duplicate", "reordered", "lost", "longer", "endless"] = "right"
    faulty_every: int = 1

    time_stamps: bool = False  # True: a time stamp follows each frame
    flood: float = 0.0  # broadcast frames per second, from PRE-OP on

    def __post_init__(self) -> None:
        for text in (self.ip, self.mask, self.gateway, self.dns):
            if text:
                IPv4Address(text)
        if len(bytes.fromhex(self.mac.replace(":", " "))) != 6:
            raise ValueError(f"mac must have 6 bytes, not {self.mac}")
        if not self.name.isascii() or len(self.name) > 32:
            raise ValueError(f"name must have at most 32 ASCII characters, not {self.name!r}")
        if not 0 <= self.flood <= FLOOD_MAX:
            raise ValueError(f"flood must be 0 to {FLOOD_MAX:.0f} frames/s, not {self.flood}")
        if self.faulty_every < 1:
            raise ValueError(f"faulty_every must be at least 1, not {self.faulty_every}")

"""Quirks: contents of SIIs that differ from ETG.2010 or from their device.

In TOML a quirk is a field of a table: `sii_quirks = { pdos = "absent" }`.
"""

from __future__ import annotations

from typing import Literal

import msgspec


class SiiQuirks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Differences of one device's SII from what the device is. Without arguments: none."""

    # Size of both mailboxes in the header; the device has another one. An EEPROM that was erased
    # beyond its identity has 65535.
    mailbox_size: int | None = None

    # Number of entries in the SyncManager category, filled up with unused ones. A controller has 16
    # at most (ESC data sheet, register 0x0800).
    sync_managers: int | None = None

    # Category 50 and 51. "absent": the PDOs are in the object dictionary alone (MetalMusings
    # EaserCAT 2000 and 6000). "unnamed": PDOs and entries have string 0 as their name.
    pdos: Literal["named", "unnamed", "absent"] = "named"

    # Put before every string, to show what a terminal makes of it.
    text_prefix: str = ""

    def __post_init__(self) -> None:
        if self.mailbox_size is not None and not 0 <= self.mailbox_size <= 0xFFFF:
            raise ValueError(f"mailbox_size is 0 to 65535, not {self.mailbox_size}")
        if self.sync_managers is not None and not 0 <= self.sync_managers <= 255:
            raise ValueError(f"sync_managers is 0 to 255, not {self.sync_managers}")


NO_SII_QUIRKS = SiiQuirks()

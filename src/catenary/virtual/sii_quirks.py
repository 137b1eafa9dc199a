"""Quirks of the SII: contents that differ from ETG.2010 or from the device.

In TOML a quirk is a field of a table: `sii_quirks = { pdos = "absent" }`.
"""

from __future__ import annotations

from typing import Literal

import msgspec


class SiiQuirks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Differences between the SII of a device and the device itself. The default has none."""

    # Size of both mailboxes in the SII header, if it differs from that of the device. An EEPROM
    # that is erased after the identity contains 65535.
    mailbox_size: int | None = None

    # Number of entries in the SyncManager category, which is truncated, or padded with unused
    # entries. A controller has at most 16 SyncManagers (ESC data sheet, register 0x0800).
    sync_managers: int | None = None

    # Content of categories 50 and 51. "absent": only the object dictionary lists the PDOs
    # (MetalMusings EaserCAT 2000 and 6000). "unnamed": PDOs and entries have no names (string 0).
    pdos: Literal["named", "unnamed", "absent"] = "named"

    # Prefix of every string, to test how a terminal displays it.
    text_prefix: str = ""

    def __post_init__(self) -> None:
        if self.mailbox_size is not None and not 0 <= self.mailbox_size <= 0xFFFF:
            raise ValueError(f"mailbox_size must be 0 to 65535, not {self.mailbox_size}")
        if self.sync_managers is not None and not 0 <= self.sync_managers <= 255:
            raise ValueError(f"sync_managers must be 0 to 255, not {self.sync_managers}")


NO_SII_QUIRKS = SiiQuirks()

"""Quirks of process data: mappings that cannot be changed, or that differ from the SII.

In TOML a quirk is a field of a table: `mapping_quirks = { fixed_pdos = "silent" }`.
"""

from __future__ import annotations

from typing import Literal

import msgspec

Fixed = Literal["no", "declared", "silent"]


class MappingQuirks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Restrictions of a device's PDO objects. The default has none."""

    # PDO entries (0x16xx, 0x1Axx) cannot be written. "declared": SII flag 0x0010 and the access
    # rights in the dictionary indicate this, as in Kollmorgen's AKD for 0x1701 to 0x1B26 (AKD
    # EtherCAT manual, "Fixed PDO Mappings"). "silent": nothing indicates it, but writes are refused
    # (OpenEtherCATsociety/SOEM#924 and #598: 0x1600 cannot be written, 0x1C12 can).
    fixed_pdos: Fixed = "no"

    # The PDO assignments (0x1C12, 0x1C13) cannot be written. They are constants (ATYPE_RO) in
    # OpenEtherCATsociety/SOES, applications/raspberry_lan9252demo/slave_objectlist.c.
    fixed_lists: Fixed = "no"

    # Abort code of an undeclared refusal. Most devices use 0x06010002; Beckhoff's EL2535 uses
    # 0x08000021 (OpenEtherCATsociety/SOEM#311).
    abort_code: int = 0x0601_0002

    # PDOs that the dictionary assigns at power-up, instead of those in the SII. The PDOs of an
    # EL6900 differ from its description (sittner/linuxcnc-ethercat#97).
    power_up: tuple[int, ...] | None = None

    # PDOs that contain the same object cannot be assigned together. Examples are the standard and
    # compact PDOs of Beckhoff's EL30xx (infosys.beckhoff.com, el30xx, "Changeover of process data
    # sets"). The abort code is 0x08000021 (SOEM#311).
    exclusive: bool = False

    # Objects that cannot be mapped (0x06040041), although the dictionary marks them as mappable.
    refused_objects: tuple[int, ...] = ()

    # CoE details in the SII, ETG.2010 table 5. 0x2F sets all bits except bit 4. If bit 2 is clear,
    # the SII declares that the PDO assignment cannot be changed; bit 3 does so for the PDO entries.
    # The details do not change the object dictionary.
    coe_details: int = 0x2F

    def __post_init__(self) -> None:
        if not 0 <= self.abort_code <= 0xFFFF_FFFF:
            raise ValueError(f"abort_code must be a 32-bit number, not {self.abort_code}")
        if not 0 <= self.coe_details <= 0x3F:
            raise ValueError(f"coe_details must be 0 to 0x3F, not {self.coe_details:#x}")


NO_MAPPING_QUIRKS = MappingQuirks()

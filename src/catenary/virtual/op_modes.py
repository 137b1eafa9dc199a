"""OpModes of a virtual device: its modes of distributed clocks, SII category 60 (ETG.2010).

In TOML: `quirks = { op_modes = [{ name = "DC", assign_activate = 0x0700, sync1_factor = -1 }] }`.
"""

from __future__ import annotations

import msgspec


class OpMode(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A mode of distributed clocks. Times are in ns, as in the SII."""

    name: str
    assign_activate: int = 0  # registers 0x0980 (low byte) and 0x0981
    sync0_ns: int = 0
    sync0_factor: int = 0
    shift_ns: int = 0
    sync1_factor: int = 0
    sync1_shift_ns: int = 0

    def __post_init__(self) -> None:
        for name, bits in (("sync0_ns", 32), ("assign_activate", 16)):
            if not 0 <= getattr(self, name) < 1 << bits:
                raise ValueError(
                    f"OpMode {self.name!r}: {name} must be an unsigned {bits}-bit number, "
                    f"not {getattr(self, name)}"
                )
        for name, bits in (
            *(("shift_ns", 32), ("sync1_shift_ns", 32)),
            *(("sync0_factor", 16), ("sync1_factor", 16)),
        ):
            if not -(1 << bits - 1) <= getattr(self, name) < 1 << bits - 1:
                raise ValueError(
                    f"OpMode {self.name!r}: {name} must be a signed {bits}-bit number, "
                    f"not {getattr(self, name)}"
                )


FREE_RUN = OpMode(name="FreeRun")
STANDARD = (FREE_RUN, OpMode(name="DC Sync0", assign_activate=0x0300, sync0_factor=1))

# ESI of Beckhoff's EL3702, as quoted in ecmc's notes on DC clocks: four samples and one SYNC1 per
# period. A servo with these modes needs `sync_signal="sync1"`.
EL3702 = (
    *STANDARD,
    OpMode(
        name="DcSync4",
        assign_activate=0x0730,
        sync0_factor=-4,
        shift_ns=-10_000,
        sync1_factor=-1,
    ),
)

# ESI in robert-burger/libethercat#21. It has no mode with SYNC0; TwinCAT starts only SYNC1.
SYNC1_ALONE = (
    OpMode(name="DcSync500us", assign_activate=0x0500, sync0_factor=1, shift_ns=500_000),
    OpMode(name="DcSync250us", assign_activate=0x0500, sync0_factor=1, shift_ns=250_000),
    OpMode(name="FreeRun"),
)

# Modes that AB&T's EasyConfigurator writes for every EasyCAT. The shift is 2.0 s; a comment in the
# file gives its unit as "10nS unit" (Seobuk/Easycat_config, HUslave.xml; pollen-robotics'
# pollen_Orbita2d.xml).
EASYCAT = (
    OpMode(name="SM_Sync or Async"),
    OpMode(name="DC_Sync", assign_activate=0x0300, sync0_factor=1, shift_ns=2_000_200_000),
)

# The same modes, stored by another tool without AssignActivate and with a different shift
# (pollen_Orbita2d.bin).
EASYCAT_STORED = (
    OpMode(name="SM_Sync or Async"),
    OpMode(name="DC_Sync", shift_ns=1_882_234_944),
)

"""Quirks of real drives: behaviour that differs from CiA 402 (IEC 61800-7-201).

In TOML a quirk is a field of a table: `quirks = { bit_12 = "never" }`.
"""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from catenary.virtual.op_modes import STANDARD, OpMode

MODES = (6, 8, 9, 10)  # homing, CSP, CSV, CST
OPTION_CODES = range(-(1 << 15), 1 << 15)


class ServoQuirks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Differences of a drive from the profile, for all its axes. The default has none."""

    # Bit 12 of the statusword in the cyclic modes. "never": it is always 0. leducp/KickCAT,
    # lib/simulation/include/kickcat/simulation/devices/Ds402Motor.h shows 0x37 when enabled.
    bit_12: Literal["standard", "never"] = "standard"

    # True: the drive follows its targets while bit 12 is 0, as in Ds402Motor.h. False: the drive
    # ignores them and holds its last demand, as IEC 61800-7-201 specifies for bit 12 = 0.
    follows_without_bit_12: bool = False

    # True: while enabled, the drive ignores controlword 0x02. Source: Ds402Motor.h, "any other
    # command: hold the current state". See also `quick_stop_option`.
    ignores_quick_stop: bool = False

    # True: while enabled, the drive ignores controlword 0x07. No such drive has been reported. The
    # last step of a stop (disable voltage) is for this case.
    ignores_disable: bool = False

    # Initial value of 0x605A. 0: the torque is removed immediately. Negative: the quick stop is
    # disabled, as with -1 in Beckhoff's AX8000 (infosys.beckhoff.com, ax8xxx_object, 605A
    # "Disable_quick_stop"). "absent": the object does not exist (abort 0x06020000) and the drive
    # ramps down as with 2. wangpinganliuyang/GDC16, SSC/Src/cia402appl.c, is an example of a quick
    # stop without 0x605A.
    quick_stop_option: int | Literal["absent"] = 2

    # Initial value of 0x6007 (IEC 61800-7-201), the reaction to a loss of process data.
    # 0: none, 1: fault, 2: disable voltage, 3: quick stop as set in 0x605A.
    abort_connection_option: int = 1

    # Delay from 0x6060 to 0x6061 [s], during which the old mode stays active. ipa320/ipa_canopen#29
    # and jia-xie/python-damiao-driver#4 changed their timing for drives that need more than one
    # cycle.
    mode_delay: float = 0.0

    # Modes that 0x6060 accepts but 0x6061 never shows. An example is a drive that changes its mode
    # only before operation enabled (ipa320/ipa_canopen#29).
    refused_modes: tuple[int, ...] = ()

    # Modes of distributed clocks in category 60 of the SII. `virtual.op_modes` contains those of an
    # EL3702 (SYNC1 with a negative factor), of a device with only SYNC1, and of an EasyCAT (a shift
    # of 2.0 s), with their sources.
    op_modes: tuple[OpMode, ...] = STANDARD

    # Signal to which the drive synchronises. "sync1": the drive refuses clocks without SYNC1, and
    # 0x1C32:04 shows only DC Sync1. In robert-burger/libethercat#21, only 0x0500 leads to OP.
    sync_signal: Literal["sync0", "sync1"] = "sync0"

    # True: loop control (0x0101) can close the ports. False: DL status never shows a closed port.
    # leducp/KickCAT, lib/slave/src/ESC/EmulatedESC.cc, evaluates only bit 24 of DL control.
    closes_ports: bool = True

    # True: SyncManager 2 triggers the watchdog (control byte 0x64 in the SII). False: the byte is
    # 0x24, as in three SIIs of leducp/KickCAT (examples/slave: lan9252/freedom-k64f, lan9252/rpi
    # and xmc4800/xmc4800-relax) and in both of MetalMusings' EaserCAT boards.
    watchdog_trigger: bool = True

    # True: the drive refuses SAFE-OP with AL status code 0x001F, "invalid watchdog configuration",
    # unless the trigger bit is set exactly when the watchdog is active: its time and divider are
    # not 0, and the device has outputs. Source: Beckhoff's slave stack code (SSC 5.11 to 5.13),
    # ecatslv.c, StartInputHandler.
    checks_watchdog: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.mode_delay < math.inf:
            raise ValueError(f"mode_delay must be at least 0 s and finite, not {self.mode_delay}")
        for mode in self.refused_modes:
            if mode not in MODES:
                raise ValueError(f"refused_modes must be among {MODES}, not {mode}")
        if self.quick_stop_option != "absent" and self.quick_stop_option not in OPTION_CODES:
            raise ValueError(
                "quick_stop_option must be a signed 16-bit number or 'absent', "
                f"not {self.quick_stop_option!r}"
            )
        if self.abort_connection_option not in (0, 1, 2, 3):
            raise ValueError(
                f"abort_connection_option must be 0 to 3, not {self.abort_connection_option}"
            )

    @property
    def refused_mask(self) -> int:
        """Bit mask of the refused modes: bit n for mode n."""
        return sum(1 << mode for mode in set(self.refused_modes))


NO_QUIRKS = ServoQuirks()

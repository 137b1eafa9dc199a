"""Contents of events: register writes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from catenary.capture.text import duration, not_accepted, value_text
from catenary.wire.clock import Activation
from catenary.wire.fmmu import Fmmu
from catenary.wire.register_names import at_address
from catenary.wire.register_text import explain
from catenary.wire.sync_manager import WATCHDOG_TRIGGER


@dataclass(frozen=True, slots=True)
class RegisterWrite:
    """The master wrote a register that has no event of its own."""

    kind: ClassVar[str] = "register"
    address: int
    data: bytes
    accepted: bool = True

    def __str__(self) -> str:
        found = at_address(self.address, len(self.data)) or at_address(self.address)
        name = f" {found.name}" if found else ""
        is_whole = found is not None and found.size == len(self.data) and any(self.data)
        meaning = explain(found, self.data) if found and is_whole else None
        text = f"0x{self.address:04X}{name} = {value_text(self.data)}"
        return f"{text}{f' ({meaning})' if meaning else ''}{not_accepted(self.accepted)}"


@dataclass(frozen=True, slots=True)
class SyncManagerWrite:
    """The master wrote a SyncManager, or a part of it. The values are complete."""

    kind: ClassVar[str] = "sync-manager"
    number: int
    address: int
    length: int
    control: int
    enabled: bool
    accepted: bool = True

    @property
    def watchdog(self) -> bool:
        """True if a write of the buffer triggers the process-data watchdog."""
        return bool(self.control & WATCHDOG_TRIGGER)

    def __str__(self) -> str:
        off = "" if self.enabled else " off"
        return (
            f"SM{self.number} 0x{self.address:04X} len {self.length} ctrl 0x{self.control:02X}{off}"
            f"{not_accepted(self.accepted)}"
        )


@dataclass(frozen=True, slots=True)
class FmmuWrite:
    """The master wrote an FMMU."""

    kind: ClassVar[str] = "fmmu"
    number: int
    fmmu: Fmmu
    accepted: bool = True

    def __str__(self) -> str:
        found = self.fmmu
        if not found.enabled:
            return f"FMMU{self.number} off{not_accepted(self.accepted)}"
        uses = [text for on, text in ((found.reads, "in"), (found.writes, "out")) if on]
        return (
            f"FMMU{self.number} {'+'.join(uses) or 'unused'} logical 0x{found.logical_address:08X} "
            f"len {found.length} bits {found.logical_start_bit}-{found.logical_end_bit} "
            f"physical 0x{found.physical_address:04X}:{found.physical_start_bit}"
            f"{not_accepted(self.accepted)}"
        )


@dataclass(frozen=True, slots=True)
class SyncUnitWrite:
    """The master activated or stopped SYNC0 and SYNC1.

    `assign_activate` is the word at 0x0980: AssignActivate in the ESI. The cycle times are those
    that the master wrote before, else 0.
    """

    kind: ClassVar[str] = "sync"
    assign_activate: int
    sync0_ns: int
    sync1_ns: int
    start_ns: int
    accepted: bool = True

    def __str__(self) -> str:
        text = f"AssignActivate 0x{self.assign_activate:04X}"
        active = Activation(self.assign_activate >> 8)
        if Activation.CYCLIC_OPERATION not in active:
            return f"SYNC off, {text}{not_accepted(self.accepted)}"
        if Activation.SYNC1 in active:
            text = f"SYNC1 {duration(self.sync1_ns)}, {text}"
        return f"SYNC0 {duration(self.sync0_ns)}, {text}{not_accepted(self.accepted)}"


@dataclass(frozen=True, slots=True)
class EepromAssigned:
    """The master assigned the EEPROM interface to EtherCAT or to the device's processor."""

    kind: ClassVar[str] = "eeprom"
    to_device: bool
    forced: bool = False
    accepted: bool = True

    def __str__(self) -> str:
        owner = "the device" if self.to_device else "EtherCAT"
        forced = ", forced" if self.forced else ""
        return f"EEPROM assigned to {owner}{forced}{not_accepted(self.accepted)}"


@dataclass(frozen=True, slots=True)
class EepromWrite:
    """The master wrote a word of the EEPROM."""

    kind: ClassVar[str] = "eeprom-write"
    word: int
    data: bytes

    def __str__(self) -> str:
        return f"EEPROM word 0x{self.word:04X} = 0x{int.from_bytes(self.data, 'little'):04X}"

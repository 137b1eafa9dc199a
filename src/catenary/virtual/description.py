"""What a virtual device says of itself: its SII image and its objects are made of this."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS, MappingQuirks
from catenary.virtual.op_modes import STANDARD, OpMode

# Private: no vendor of the EtherCAT Technology Group has this identity ("CTNY" in ASCII).
VENDOR_ID = 0x43544E59


@dataclass(frozen=True, slots=True)
class MappedEntry:
    """One entry of a PDO; index 0 is a gap of `bits`."""

    index: int
    subindex: int
    bits: int
    name: str
    data_type: int = 0  # CANopen's number, ETG.1020


@dataclass(frozen=True, slots=True)
class Pdo:
    index: int
    name: str
    entries: tuple[MappedEntry, ...]
    sync_manager: int  # 0xFF: not assigned by default

    @property
    def bits(self) -> int:
        return sum(entry.bits for entry in self.entries)


@dataclass(frozen=True, slots=True)
class SyncManagerDefault:
    start: int
    length: int
    control: int
    enable: int
    kind: int  # 1 mailbox out, 2 mailbox in, 3 outputs, 4 inputs


@dataclass(frozen=True, slots=True)
class MailboxDefault:
    """Offsets and sizes of the standard mailbox, seen from the MainDevice: `receive` is SM0."""

    receive_offset: int
    receive_size: int
    send_offset: int
    send_size: int
    coe_details: int  # bit 0 SDO, 1 SDO information, 2 assignment, 3 mapping, 5 complete access


@dataclass(frozen=True, slots=True)
class Description:
    name: str
    order: str
    group: str
    product_code: int
    revision: int
    serial: int
    alias: int
    emulation: bool  # AL status follows AL control: no microcontroller
    pdi_type: int
    mailbox: MailboxDefault | None
    sync_managers: tuple[SyncManagerDefault, ...]
    fmmus: tuple[int, ...]  # usage: 1 outputs, 2 inputs, 3 mailbox status
    rx_pdos: tuple[Pdo, ...]
    tx_pdos: tuple[Pdo, ...]
    clock: bool
    axes: int = 0
    ram: int = 0x2000  # bytes from 0x1000 on
    slots: int = 0
    current_milliampere: int = 0
    identification: int = 0
    ports: tuple[int, ...] = (0, 1)
    mapping_quirks: MappingQuirks = NO_MAPPING_QUIRKS
    op_modes: tuple[OpMode, ...] = STANDARD  # of a device with clock and axes
    loop_control: bool = True  # its ports can be closed (0x0101)

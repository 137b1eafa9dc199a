"""Description of a virtual device, from which its SII image and its objects are made."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

from catenary.virtual.mapping_quirks import NO_MAPPING_QUIRKS, MappingQuirks
from catenary.virtual.op_modes import STANDARD, OpMode

# Private vendor ID, not assigned by the EtherCAT Technology Group ("CTNY" in ASCII).
VENDOR_ID = 0x43544E59


@dataclass(frozen=True, slots=True)
class MappedEntry:
    """Entry of a PDO. Index 0 denotes a gap of `bits`."""

    index: int
    subindex: int
    bits: int
    name: str
    data_type: int = 0  # CANopen data type, ETG.1020


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
    """Offsets and sizes of the standard mailbox, named as in the SII: `receive` is SM0."""

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
    serial: int
    alias: int
    emulation: bool  # AL status follows AL control, without a microcontroller
    pdi_type: int
    mailbox: MailboxDefault | None
    sync_managers: tuple[SyncManagerDefault, ...]
    fmmus: tuple[int, ...]  # usage: 1 outputs, 2 inputs, 3 mailbox status
    rx_pdos: tuple[Pdo, ...]
    tx_pdos: tuple[Pdo, ...]
    clock: bool  # True if the device has distributed clocks
    axes: int = 0
    ram: int = 0x2000  # bytes from 0x1000 on
    slots: int = 0
    current_milliampere: int = 0
    identification: int = 0
    ports: tuple[int, ...] = (0, 1)
    mapping_quirks: MappingQuirks = NO_MAPPING_QUIRKS
    op_modes: tuple[OpMode, ...] = STANDARD  # for devices with a clock and axes
    loop_control: bool = True  # True if 0x0101 can close the ports
    lrw: bool = True
    sii_variant: str = ""  # differences of the SII from the device

    @property
    def revision(self) -> int:
        """Revision number: 1 in the upper word, a checksum of the description in the lower word.

        The checksum does not include names, serial number, alias and device ID. It distinguishes
        devices whose SIIs differ otherwise, because SOEM reads the SII only once for all devices
        with the same identity (src/ec_config.c, ecx_lookup_prev_sii).
        """
        kind = replace(self, name="", order="", group="", serial=0, alias=0, identification=0)
        return 0x0001_0000 | zlib.crc32(repr(kind).encode()) & 0xFFFF

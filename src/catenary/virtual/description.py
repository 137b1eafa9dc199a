"""Description of a virtual device, from which its SII image and its objects are made."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, replace

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
    fixed: bool = field(default=False, repr=False)  # its entries cannot be written
    mandatory: bool = field(default=False, repr=False)
    excludes: frozenset[int] = field(default=frozenset(), repr=False)

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
    """Offsets and sizes of a mailbox, named as in the SII: `receive` is SM0."""

    receive_offset: int
    receive_size: int
    send_offset: int
    send_size: int
    coe_details: int  # bit 0 SDO, 1 SDO information, 2 assignment, 3 mapping, 5 complete access

    @property
    def areas(self) -> tuple[int, int, int, int]:
        """Offset and size of both directions, in the order of the SII."""
        return self.receive_offset, self.receive_size, self.send_offset, self.send_size


@dataclass(frozen=True, slots=True)
class Channel:
    """Process data of one SyncManager."""

    sync_manager: int
    outputs: bool
    start: int  # address of the buffers
    room: int  # maximum size of a buffer [bytes]
    idle_length: int = 0  # of the SyncManager in the SII, which may remain without PDOs [bytes]

    @property
    def assignment(self) -> int:
        """Index of the object that assigns its PDOs: 0x1C12 for SyncManager 2."""
        return 0x1C10 + self.sync_manager

    @property
    def control(self) -> int:
        """Direction and mode in the control byte of the SyncManager: three buffers."""
        return 0x04 if self.outputs else 0x00


@dataclass(frozen=True, slots=True)
class FileFacts:
    """Facts of a device that comes from a file, which our own kinds of devices derive."""

    vendor: int
    revision: int
    channels: tuple[Channel, ...]
    device_type: int  # object 0x1000
    sdo_information: bool = True
    complete_access: bool = True


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
    op_modes: tuple[OpMode, ...] = STANDARD  # of a clock; STANDARD only for devices with axes
    loop_control: bool = True  # True if 0x0101 can close the ports
    lrw: bool = True
    sii_variant: str = ""  # differences of the SII from the device
    fmmu_count: int = field(default=8, repr=False)  # not repr: the revision depends on it
    sync_manager_count: int = field(default=8, repr=False)
    facts: FileFacts | None = field(default=None, repr=False)  # None: one of our own kinds
    bootstrap: MailboxDefault | None = field(default=None, repr=False)  # mailbox in BOOT
    serves_files: bool = field(default=False, repr=False)  # FoE
    protocols: tuple[int, ...] = field(default=(), repr=False)  # beside CoE and FoE

    @property
    def vendor(self) -> int:
        """Vendor ID."""
        return VENDOR_ID if self.facts is None else self.facts.vendor

    @property
    def revision(self) -> int:
        """Revision number of the file; for our own kinds one that the description determines.

        It has 1 in the upper word, a checksum of the description in the lower word.

        The checksum does not include names, serial number, alias and device ID. It distinguishes
        devices whose SIIs differ otherwise, because SOEM reads the SII only once for all devices
        with the same identity (src/ec_config.c, ecx_lookup_prev_sii).
        """
        if self.facts is not None:
            return self.facts.revision
        kind = replace(self, name="", order="", group="", serial=0, alias=0, identification=0)
        return 0x0001_0000 | zlib.crc32(repr(kind).encode()) & 0xFFFF

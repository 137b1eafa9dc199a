"""Values of a clone: what was read from the devices of a segment, without changing it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from catenary.errors import DecodeError
from catenary.model.device import Identity, MailboxLayout
from catenary.wire.error_counters import ErrorCounters, decode_error_counters
from catenary.wire.features import Information, decode_information
from catenary.wire.fmmu import Fmmu, decode_fmmu
from catenary.wire.register import (
    DL_STATUS,
    ERROR_COUNTERS,
    FMMU_COUNT,
    INFORMATION,
    SYNC_MANAGER_COUNT,
    Register,
    fmmu,
    sync_manager,
)
from catenary.wire.sdo_information import Access
from catenary.wire.sync_manager import SyncManager, decode_sync_manager

SERIAL_WITHHELD = "withheld"  # reason for a value that was left out on request


@dataclass(frozen=True, slots=True)
class ClonedEntry:
    """One entry of an object dictionary.

    `value` is None if it was not read. `abort` is the abort code of a refused upload. `reason`
    explains a missing value or description in other cases. `data_type`, `bit_length` and `access`
    are 0 if the device does not describe the entry.
    """

    index: int
    subindex: int
    data_type: int
    bit_length: int
    access: Access
    name: str = ""
    value: bytes | None = None
    abort: int | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class ClonedObject:
    """One object of a dictionary, with the entries that exist.

    `code` is 0 if the device lists the object, but does not describe it. `reason` then has the
    cause; it also explains missing entries.
    """

    index: int
    code: int  # an ObjectCode, or an undefined number from the device
    data_type: int
    maximum_subindex: int
    name: str = ""
    entries: tuple[ClonedEntry, ...] = ()
    reason: str = ""

    def entry(self, subindex: int) -> ClonedEntry | None:
        """Return the entry with this subindex; None if there is none."""
        return next((each for each in self.entries if each.subindex == subindex), None)


@dataclass(frozen=True, slots=True)
class MappedEntry:
    """One entry of a PDO mapping; a gap has index 0."""

    index: int
    subindex: int
    bit_length: int

    def __str__(self) -> str:
        return f"0x{self.index:04X}:{self.subindex:02X} {self.bit_length}"


@dataclass(frozen=True, slots=True)
class ClonedPdo:
    """One PDO and its mapped entries."""

    index: int
    entries: tuple[MappedEntry, ...]


@dataclass(frozen=True, slots=True)
class ClonedAssignment:
    """The PDOs that are assigned to one SyncManager."""

    sync_manager: int
    pdos: tuple[ClonedPdo, ...]


@dataclass(frozen=True, slots=True)
class ClonedDevice:
    """One device of a clone.

    `missing` maps the parts that could not be read ("sii", "objects") to the reason, and "state" if
    a raised device could not be brought back. A part that the device does not have is not missing:
    `objects` is () for a device without CoE.
    """

    position: int
    name: str
    identity: Identity | None  # None if the SII was not read; serial 0 if it was withheld
    station_address: int
    alias: int
    al_status: int  # when the clone was started
    al_status_code: int
    registers: Mapping[int, bytes] = field(default_factory=dict)  # blocks by first address
    order: str = ""
    group: str = ""
    parent: int | None = None  # position of the device before it in the tree
    parent_port: int | None = None
    raised: bool = False  # brought from INIT to PRE-OP while it was read
    mailbox: MailboxLayout | None = None
    assignments: tuple[ClonedAssignment, ...] = ()
    mapping_source: str = ""  # "CoE" or "SII"; empty if the assignment is unknown
    sii: bytes | None = None  # None if it was not read
    objects: tuple[ClonedObject, ...] = ()
    missing: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """True if no part is missing."""
        return not self.missing

    @property
    def information(self) -> Information | None:
        """Controller type, memory, FMMUs, SyncManagers and ports; None if not read."""
        data = self.registers.get(INFORMATION.address)
        return None if data is None else decode_information(data)

    @property
    def dl_status(self) -> int:
        """DL status (0x0110), which contains the open ports; 0 if not read."""
        return int.from_bytes(self.registers.get(DL_STATUS.address, b""), "little")

    @property
    def sync_managers(self) -> tuple[SyncManager, ...]:
        """SyncManagers as configured. The status byte is always 0.

        A SyncManager with an invalid control byte ends the list.
        """
        found = []
        for k in range(SYNC_MANAGER_COUNT):
            data = self.registers.get(sync_manager(k).address)
            try:
                found += [] if data is None else [decode_sync_manager(data)]
            except DecodeError:
                break
        return tuple(found)

    @property
    def fmmus(self) -> tuple[Fmmu, ...]:
        """FMMUs as configured."""
        blocks = (self.registers.get(fmmu(k).address) for k in range(FMMU_COUNT))
        return tuple(decode_fmmu(data) for data in blocks if data is not None)

    @property
    def error_counters(self) -> ErrorCounters | None:
        """Error counters of the ports; None if not read."""
        data = self.registers.get(ERROR_COUNTERS.address)
        return None if data is None else decode_error_counters(data)

    def register(self, of: Register[int]) -> int | None:
        """Return the value of a register that was read as a block of its own; else None."""
        data = self.registers.get(of.address)
        return None if data is None or len(data) != of.size else of.unpack(data)

    def object(self, index: int) -> ClonedObject | None:
        """Return the object with this index; None if there is none."""
        return next((each for each in self.objects if each.index == index), None)

    def value(self, index: int, subindex: int) -> bytes | None:
        """Return the value of an entry; None if it was not read.

        Args:
            index: Index of the object.
            subindex: Subindex of the entry.
        """
        found = self.object(index)
        entry = None if found is None else found.entry(subindex)
        return None if entry is None else entry.value


@dataclass(frozen=True, slots=True)
class Line:
    """A clone: the devices of a segment by position."""

    devices: tuple[ClonedDevice, ...]
    serials: bool = True  # False if serial numbers were left out
    notes: tuple[str, ...] = ()  # contradictions of the wiring

    @property
    def complete(self) -> bool:
        """True if no device has a missing part."""
        return all(device.complete for device in self.devices)

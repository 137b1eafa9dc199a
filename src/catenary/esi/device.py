"""Devices and modules of an ESI file (ETG.2000), as values. Nothing here reads a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from catenary.esi.dictionary import EsiDictionary
from catenary.esi.source import NO_SOURCE, EsiWarning, Source
from catenary.model.device import Direction
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse


class DeviceKey(NamedTuple):
    """Vendor, product and revision: the key of a device in a library."""

    vendor: int
    product: int
    revision: int

    def __str__(self) -> str:
        return f"0x{self.vendor:08X}:0x{self.product:08X}:0x{self.revision:08X}"


class RevisionCheck(StrEnum):
    """Rule for the revision of a device, against the revision in the file (`CheckRevisionNo`).

    HW is the high word of the revision, LW the low word.
    """

    NONE = ""
    EQUAL = "EQ"
    EQUAL_OR_GREATER = "EQ_OR_G"
    LOW_EQUAL = "LW_EQ"
    LOW_EQUAL_OR_GREATER = "LW_EQ_OR_G"
    LOW_EQUAL_HIGH_EQUAL_OR_GREATER = "LW_EQ_HW_EQ_OR_G"
    HIGH_EQUAL = "HW_EQ"
    HIGH_EQUAL_OR_GREATER = "HW_EQ_OR_G"
    HIGH_EQUAL_LOW_EQUAL_OR_GREATER = "HW_EQ_LW_EQ_OR_G"


@dataclass(frozen=True, slots=True)
class EsiSyncManager:
    """One SyncManager (`Sm`)."""

    index: int
    use: SyncManagerUse
    start: int  # physical address
    default_size: int = 0  # [bytes]
    min_size: int | None = None
    max_size: int | None = None
    control: int = 0
    enabled: bool = True
    virtual: bool = False
    op_only: bool = False
    fixed_assignment: bool = False  # the list of its PDOs cannot be changed
    name: str = ""  # text of the element: MBoxOut, Outputs ...
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EsiEntry:
    """One object in a PDO. Index 0 marks a gap."""

    index: int
    subindex: int
    bit_length: int
    name: str = ""
    type: str = ""  # name of the data type, as in the file; empty for a gap
    fixed: bool = False
    depends_on_slot: bool = False  # the index increases by the slot's index increment
    comment: str = ""


@dataclass(frozen=True, slots=True)
class EsiPdo:
    """A process data object (`RxPdo` or `TxPdo`)."""

    direction: Direction
    index: int
    name: str
    entries: tuple[EsiEntry, ...]
    sync_manager: int | None = None  # default assignment; None if not assigned
    fixed: bool = False  # its entries cannot be changed
    mandatory: bool = False
    virtual: bool = False  # has no entries on the device
    excludes: frozenset[int] = frozenset()  # PDOs that cannot be assigned together with it
    excluded_sync_managers: frozenset[int] = frozenset()  # it cannot be assigned to these
    oversampling_max: int = 0  # 0: no oversampling
    depends_on_slot: bool = False  # its index increases by the slot's PDO increment
    excludes_depend_on_slot: bool = False
    overwritten_by_module: bool = False
    source: Source = NO_SOURCE

    @property
    def bit_length(self) -> int:
        """Total length of the entries [bits]."""
        return sum(entry.bit_length for entry in self.entries)


@dataclass(frozen=True, slots=True)
class EsiInitCommand:
    """Object that the MainDevice writes at state transitions (`CoE/InitCmd`)."""

    transitions: tuple[str, ...]  # such as ("PS",): PRE-OP to SAFE-OP
    index: int
    subindex: int
    data: bytes
    complete_access: bool = False
    fixed: bool = False  # the user cannot change it
    overwritten_by_module: bool = False
    depends_on_slot: bool = False
    timeout_ms: int = 0  # 0: the default
    comment: str = ""
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EsiIdnCommand:
    """IDN that the MainDevice writes at state transitions (`SoE/InitCmd`)."""

    transitions: tuple[str, ...]
    number: int  # IDN
    data: bytes
    drive: int = 0  # `Chn`
    comment: str = ""
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EsiMailbox:
    """Mailbox protocols and their properties (`Mailbox`)."""

    protocols: MailboxProtocol
    complete_access: bool = False
    sdo_information: bool = False
    pdo_assign: bool = False
    pdo_configuration: bool = False
    pdo_upload: bool = False
    segmented_sdo: bool = False
    data_link_layer: bool = False
    drive_channels: int = 0  # DS402Channels
    init_commands: tuple[EsiInitCommand, ...] = ()
    idn_commands: tuple[EsiIdnCommand, ...] = ()
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EsiModeSyncManager:
    """Settings of one SyncManager in an OpMode (`OpMode/Sm`)."""

    index: int
    sync_type: int | None = None
    cycle_ns: int | None = None
    shift_ns: int | None = None
    pdos: tuple[int, ...] = ()  # PDOs to assign in this mode; empty: as assigned
    oversampling: tuple[int, ...] = ()  # factor of each of these PDOs; 1 without oversampling


@dataclass(frozen=True, slots=True, repr=False)
class EsiOpMode:
    """One mode of the distributed clocks (`Dc/OpMode`). Its repr is one line, for lists."""

    name: str
    description: str = ""
    assign_activate: int = 0
    sync0_ns: int = 0
    sync0_factor: int = 0
    shift_ns: int = 0
    shift_factor: int = 0  # `ShiftTimeSync0/@Factor`: the shift is a part of the cycle time
    shift_of_inputs: bool = False  # `ShiftTimeSync0/@Input`: the shift applies to input modules
    sync1_ns: int = 0
    sync1_factor: int = 0
    sync1_shift_ns: int = 0
    sync_managers: tuple[EsiModeSyncManager, ...] = ()
    source: Source = NO_SOURCE

    def __repr__(self) -> str:
        name = f"{self.name!r}, {self.description!r}" if self.description else repr(self.name)
        parts = [name, f"AssignActivate 0x{self.assign_activate:04X}"]
        if self.assign_activate:
            cycle = f"{self.sync0_ns} ns" if self.sync0_ns else f"factor {self.sync0_factor}"
            parts.append(f"SYNC0 {cycle}, shift {self.shift_ns} ns")
        return f"<OpMode {', '.join(parts)}, {self.source}>"


@dataclass(frozen=True, slots=True)
class EsiTimeouts:
    """Timeouts of state changes and of the mailbox [ms]; None if the file gives none."""

    pre_op: int | None = None
    safe_op_and_op: int | None = None
    back_to_init: int | None = None
    back_to_safe_op: int | None = None
    mailbox_request: int | None = None
    mailbox_response: int | None = None


@dataclass(frozen=True, slots=True)
class EsiWatchdog:
    """Watchdog registers that the file requests (`Device/ESC`); None: the controller's default."""

    divider: int | None = None  # register 0x0400
    pdi: int | None = None  # register 0x0410
    sync_managers: int | None = None  # register 0x0420


@dataclass(frozen=True, slots=True)
class EsiController:
    """Controller of the device (`Info/EtherCATController`); 0 if the file gives none."""

    dpram_size: int = 0  # [bytes]
    sync_manager_count: int = 0
    fmmu_count: int = 0


@dataclass(frozen=True, slots=True)
class EsiEepromCategory:
    """Additional category of the SII (`Eeprom/Category`)."""

    number: int
    data: bytes


@dataclass(frozen=True, slots=True)
class EsiEeprom:
    """EEPROM of the device (`Eeprom`)."""

    byte_size: int = 0
    config_data: bytes = b""  # first words of the SII
    bootstrap: bytes = b""  # words 0x14 to 0x17: bootstrap mailbox
    data: bytes = b""  # whole image, in files that give it (`Eeprom/Data`)
    assign_to_pdi: bool = False
    categories: tuple[EsiEepromCategory, ...] = ()


@dataclass(frozen=True, slots=True)
class EsiMapping:
    """Named assignment of PDOs (`AlternativeSmMapping`)."""

    name: str
    default: bool
    pdos: tuple[tuple[int, tuple[int, ...]], ...]  # SyncManager, PDO indices
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EsiSlot:
    """Slot of a modular device: the modules that it accepts."""

    name: str
    min_instances: int = 0
    max_instances: int = 1
    module_idents: tuple[int, ...] = ()
    default_ident: int | None = None  # module of the default configuration; None: empty
    module_classes: tuple[str, ...] = ()
    pdo_increment: int | None = None  # None: that of `EsiSlots`
    index_increment: int | None = None
    source: Source = NO_SOURCE

    def accepts(self, ident: int, module_class: str) -> bool:
        """Return True if the slot accepts a module. Without idents and classes, it accepts all.

        Args:
            ident: Ident of the module.
            module_class: Class of the module; empty if it has none.
        """
        if not self.module_idents and not self.module_classes:
            return True
        by_class = bool(module_class) and module_class in self.module_classes
        return by_class or ident in self.module_idents


class ModuleLabel(NamedTuple):
    """Ident, type and class of a module that the slots of a device accept."""

    ident: int
    type: str
    module_class: str = ""

    def __str__(self) -> str:
        return f"{self.type} (0x{self.ident:08X})"


@dataclass(frozen=True, slots=True)
class EsiSlots:
    """Slots of a modular device (ETG.5001). `print` lists them with the accepted modules."""

    slots: tuple[EsiSlot, ...] = ()
    max_slot_count: int | None = None
    pdo_increment: int = 0  # added to the PDO indices, times the slot number from 0
    index_increment: int = 0  # added to the object indices, times the slot number from 0
    download_module_idents: bool = False  # 0xF030 is written before SAFE-OP
    identify_by: str = ""  # `IdentifyModuleBy`
    labels: tuple[ModuleLabel, ...] = ()  # of the accepted modules that were found

    def accepted(self, slot: EsiSlot) -> tuple[ModuleLabel, ...]:
        """Return the modules that a slot accepts; one that was not found has an empty type."""
        found = tuple(each for each in self.labels if slot.accepts(each.ident, each.module_class))
        known = {each.ident for each in found}
        missing = (ModuleLabel(each, "") for each in slot.module_idents if each not in known)
        return (*found, *missing)

    def __str__(self) -> str:
        lines, number = [], 0
        for slot in self.slots:
            count = max(slot.min_instances, slot.max_instances)
            place = f"slot {number}" if count == 1 else f"slots {number} to {number + count - 1}"
            some = "required" if count == 1 else f"at least {slot.min_instances} occupied"
            lines.append(f"{place}  {slot.name}" + f"  {some}" * bool(slot.min_instances))
            for each in self.accepted(slot):
                default = "  default" if each.ident == slot.default_ident else ""
                lines.append(f"    0x{each.ident:08X}  {each.type or '(not found)'}{default}")
            number += count
        return "\n".join(lines)


@dataclass(frozen=True, slots=True)
class EsiModule:
    """Module for a slot."""

    ident: int
    type: str
    name: str
    module_class: str = ""
    pdos: tuple[EsiPdo, ...] = ()
    init_commands: tuple[EsiInitCommand, ...] = ()
    dictionary: EsiDictionary | None = None
    dictionary_file: str = ""  # file that contains the dictionary (`DictionaryFile`)
    pdo_group: int = 0  # `ModulePdoGroup`: PDOs are assigned by group, then by slot
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EsiDevice:
    """One device of an ESI file."""

    key: DeviceKey
    vendor_name: str
    type: str  # order code, such as "EL2004"
    name: str
    group: str = ""
    physics: str = ""  # one letter per port: Y MII, K E-bus, H Fast Hot Connect; blank: none
    revision_check: RevisionCheck = RevisionCheck.NONE
    hides: tuple[DeviceKey, ...] = ()  # older revisions that it replaces (`HideType`)
    alternatives: tuple[DeviceKey, ...] = ()  # compatible devices (`AlternativeType`)
    sub_devices: tuple[str, ...] = ()  # order codes of the devices inside it (`SubDevice`)
    profile: int | None = None  # `ProfileNo` of the first profile
    profile_channels: tuple[int, ...] = ()  # `ProfileNo` of each channel
    fmmus: tuple[str, ...] = ()  # texts: Outputs, Inputs, MBoxState ...
    sync_managers: tuple[EsiSyncManager, ...] = ()
    pdos: tuple[EsiPdo, ...] = ()  # of both directions, in the order of the file
    mailbox: EsiMailbox | None = None
    has_clock: bool = False  # True if the file has a `Dc` element
    op_modes: tuple[EsiOpMode, ...] = ()
    dictionary: EsiDictionary | None = None
    dictionary_file: str = ""  # file that contains the dictionary (`DictionaryFile`)
    alternative_mappings: tuple[EsiMapping, ...] = ()
    slots: EsiSlots | None = None
    modules: tuple[EsiModule, ...] = ()  # modules that its slots accept, and that were found
    controller: EsiController = EsiController()
    timeouts: EsiTimeouts = EsiTimeouts()
    watchdog: EsiWatchdog = EsiWatchdog()
    eeprom: EsiEeprom | None = None
    use_lrd_lwr: bool = False  # the device does not support LRW
    config_in_safe_op: bool = False
    e_bus_current_ma: int = 0
    diagnosis_texts: Mapping[int, str] = field(default_factory=dict)  # `DiagMessage`, by text ID
    identification_register: int | None = None  # `IdentificationReg134` or `IdentificationAdo`
    identifies_by_al_status: bool = False
    unknown: tuple[str, ...] = ()  # paths of elements that the reader does not interpret
    warnings: tuple[EsiWarning, ...] = ()
    source: Source = NO_SOURCE

    def pdos_of(self, direction: Direction) -> tuple[EsiPdo, ...]:
        """Return the PDOs of one direction, in the order of the file."""
        return tuple(pdo for pdo in self.pdos if pdo.direction is direction)

    def __str__(self) -> str:
        return f"{self.type} ({self.name}), {self.key}, {self.source}"


@dataclass(frozen=True, slots=True)
class EsiFile:
    """Contents of one ESI file: devices, modules and warnings."""

    path: str
    vendor: int
    vendor_name: str
    devices: tuple[EsiDevice, ...] = ()
    modules: tuple[EsiModule, ...] = ()
    groups: dict[str, str] = field(default_factory=dict)  # name by type
    references: tuple[str, ...] = ()  # files with further modules (`InfoReference`)
    dictionary: EsiDictionary | None = None  # of a file with the root EtherCATDict
    warnings: tuple[EsiWarning, ...] = ()

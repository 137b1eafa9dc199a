"""Description of a SubDevice: identity, memory, mailbox, SyncManagers, PDOs.

The sources are its registers (ETG.1000.4 §6.1), its SII (ETG.1000.6 §5.4, ETG.2010) and, if
present, its object dictionary (ETG.1000.6 §5.6.7.4) and its ESI file (ETG.2000). This module does
not access the network. A `source` is file and line of a fact from an ESI file; empty for others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from catenary.model.esi_settings import (
    NO_TIMEOUTS,
    NO_WATCHDOG_VALUES,
    IdnCommand,
    InitCommand,
    ModeAssignment,
    NamedMapping,
    Timeouts,
    WatchdogValues,
)
from catenary.model.module import ModularDevice
from catenary.model.process_data import (
    Assignment,
    Direction,
    Entry,
    ObjectInformation,
    Pdo,
    mapped_entries,
    mapped_pdos,
)
from catenary.model.register_command import RegisterCommand
from catenary.model.sercos_axis import SercosAxis
from catenary.wire.features import Information
from catenary.wire.sii import MailboxProtocol
from catenary.wire.sii_categories import SyncManagerUse

__all__ = [
    "Assignment",
    "DeviceDescription",
    "Direction",
    "Entry",
    "Identity",
    "MailboxLayout",
    "ObjectInformation",
    "ObjectValue",
    "OpMode",
    "Pdo",
    "SyncManager",
    "mapped_entries",
    "mapped_pdos",
]


class Identity(NamedTuple):
    """The four numbers of object 0x1018, which the SII also contains."""

    vendor: int
    product: int
    revision: int
    serial: int

    def __str__(self) -> str:
        return (
            f"vendor 0x{self.vendor:08X} product 0x{self.product:08X} "
            f"revision 0x{self.revision:08X} serial {self.serial}"
        )

    def same_kind(self, other: Identity) -> bool:
        """Return True if vendor and product are equal. Revision and serial number are ignored."""
        return (self.vendor, self.product) == (other.vendor, other.product)


@dataclass(frozen=True, slots=True)
class MailboxLayout:
    """A mailbox, as seen from the SubDevice: the MainDevice writes `receive`."""

    receive_offset: int
    receive_size: int
    send_offset: int
    send_size: int
    protocols: MailboxProtocol
    complete_access: bool = False  # SDO complete access
    sdo_information: bool = False
    pdo_assign: bool = False  # 0x1C1x can be written
    pdo_configuration: bool = False  # 0x16xx and 0x1Axx can be written
    stated: bool = True  # False if the SII does not state the four properties
    source: str = ""

    @property
    def coe(self) -> bool:
        """True if the mailbox supports CoE."""
        return MailboxProtocol.COE in self.protocols


@dataclass(frozen=True, slots=True)
class SyncManager:
    """One SyncManager, as specified in the SII (category 41)."""

    index: int
    use: SyncManagerUse
    start: int  # physical address
    length: int  # [bytes]; for process data, the size of the default mapping
    control: int  # register 0x0804 + 8·index
    enabled: bool = True
    source: str = ""


@dataclass(frozen=True, slots=True)
class OpMode:
    """One mode of a device with distributed clocks.

    The source is Dc/OpMode of an ESI file (ETG.2000), or category 60 of the SII (ETG.2010). Factors
    are multiples of the period or of SYNC0; see `plan.clocks`.
    """

    name: str = ""
    description: str = ""
    assign_activate: int = 0  # registers 0x0980 (low byte) and 0x0981
    sync0_ns: int = 0  # cycle time of SYNC0; if it is 0, `sync0_factor` applies
    sync0_factor: int = 0
    shift_ns: int = 0
    sync1_factor: int = 0
    sync1_shift_ns: int = 0
    shift_factor: int = 0  # multiple of SYNC0 that is added to the shift
    shift_of_inputs: bool = False  # the shift counts from the start of the frames
    sync1_ns: int = 0  # cycle time of SYNC1; if it is 0, `sync1_factor` applies
    assignments: tuple[ModeAssignment, ...] = ()  # empty: the mode keeps the assignment
    source: str = ""


@dataclass(frozen=True, slots=True)
class ObjectValue:
    """Value of a dictionary entry when it was read. `data` is None if it could not be read."""

    index: int
    subindex: int
    data: bytes | None


@dataclass(frozen=True, slots=True)
class DeviceDescription:
    """Description of one SubDevice at its position in the segment."""

    position: int
    station_address: int
    alias: int
    identity: Identity
    name: str
    controller: Information
    mailbox: MailboxLayout | None  # outside of BOOT
    sync_managers: tuple[SyncManager, ...]
    outputs: tuple[Assignment, ...]  # present assignment, by SyncManager
    inputs: tuple[Assignment, ...]
    output_pdos: tuple[Pdo, ...]  # all PDOs of the device, assigned or not
    input_pdos: tuple[Pdo, ...]
    open_ports: tuple[bool, bool, bool, bool] = (True, False, False, False)
    sii_denies_lrw: bool = False  # flag of the general category; the controller has another one
    parent: int | None = None  # position of the device before it in the tree
    parent_port: int | None = None
    system_time: bool = False  # the device has a clock that can be synchronised (0x0910)
    op_modes: tuple[OpMode, ...] = ()  # modes of distributed clocks, in the order of ESI or SII
    group: str = ""
    order: str = ""
    device_type: int | None = None  # object 0x1000
    slots: tuple[int, ...] = ()  # CiA 402 axes: objects + 0x800·slot
    objects: tuple[ObjectInformation, ...] = ()  # dictionary entries that were read
    values: tuple[ObjectValue, ...] = ()  # present values of objects in a start-up list
    mapping_source: str = "SII"  # or "CoE", "IgH master", "ESI FILE:LINE"
    notes: tuple[str, ...] = ()  # faults of its SII, or differences from its dictionary
    esi: str = ""  # file and line of its ESI; empty without one
    documented: tuple[ObjectInformation, ...] = ()  # dictionary of its ESI
    init_commands: tuple[InitCommand, ...] = ()
    register_commands: tuple[RegisterCommand, ...] = ()  # of an ENI, at the transitions
    idn_commands: tuple[IdnCommand, ...] = ()  # of an ESI or ENI, at the transitions
    commands_origin: str = "ESI"  # kind of the file that gives the commands: "ESI" or "ENI"
    named_mappings: tuple[NamedMapping, ...] = ()
    timeouts: Timeouts = NO_TIMEOUTS
    watchdog: WatchdogValues = NO_WATCHDOG_VALUES
    modular: ModularDevice | None = None  # slots and modules, from an ESI file
    given_name: str = ""  # name in a machine file
    bootstrap: MailboxLayout | None = None  # mailbox in BOOT; None: not stated
    sercos_axes: tuple[SercosAxis, ...] = ()  # of a device with SoE and without CoE

    @property
    def full_name(self) -> str:
        """Name for messages: that of the machine file, if there is one, then that of the device."""
        return ", ".join(name for name in dict.fromkeys((self.given_name, self.name)) if name)

    @property
    def profile(self) -> int | None:
        """Device profile number, such as 402 for drives; None if 0x1000 was not read."""
        return None if self.device_type is None else self.device_type & 0xFFFF

    @property
    def is_drive(self) -> bool:
        """True if the device has CiA 402 axes."""
        return bool(self.slots)

    @property
    def clock_bits(self) -> int:
        """Width of the system time, 64 or 32 [bits]; 0 if the device has none."""
        return self.controller.clock_bits if self.system_time else 0

    @property
    def supports_lrw(self) -> bool:
        """True if neither the controller nor the SII excludes LRW.

        SOEM checks only the SII (src/ec_config.c), IgH neither of them (master/datagram_pair.c).
        """
        return self.controller.supports_lrw and not self.sii_denies_lrw

    @property
    def coe(self) -> bool:
        """True if the mailbox supports CoE."""
        return self.mailbox is not None and self.mailbox.coe

    @property
    def soe(self) -> bool:
        """True if the mailbox supports SoE."""
        return self.mailbox is not None and MailboxProtocol.SOE in self.mailbox.protocols

    def assignments(self, direction: Direction) -> tuple[Assignment, ...]:
        """Return the assigned PDOs of one direction, by SyncManager."""
        return self.outputs if direction is Direction.OUTPUT else self.inputs

    def pdos(self, direction: Direction) -> tuple[Pdo, ...]:
        """Return all PDOs of one direction, assigned or not."""
        return self.output_pdos if direction is Direction.OUTPUT else self.input_pdos

    def with_process_data(
        self,
        direction: Direction,
        assignments: tuple[Assignment, ...],
        pdos: tuple[Pdo, ...] | None = None,
    ) -> DeviceDescription:
        """Return a copy with other process data in one direction.

        Args:
            direction: Outputs or inputs.
            assignments: The new assignment, by SyncManager.
            pdos: All PDOs of the direction; None keeps the present ones.
        """
        pdos = self.pdos(direction) if pdos is None else pdos
        if direction is Direction.OUTPUT:
            return replace(self, outputs=assignments, output_pdos=pdos)
        return replace(self, inputs=assignments, input_pdos=pdos)

    def known_object(self, index: int, subindex: int) -> ObjectInformation | None:
        """Return the description of a dictionary entry; None if it was not read.

        Args:
            index: The index of the object.
            subindex: The subindex of the entry.
        """
        for known in self.objects:
            if (known.index, known.subindex) == (index, subindex):
                return known
        return None

    def documented_object(self, index: int, subindex: int) -> ObjectInformation | None:
        """Return the description of a dictionary entry, from the device or its ESI.

        That of the device counts, unless it has no data type.

        Args:
            index: The index of the object.
            subindex: The subindex of the entry.
        """
        read = self.known_object(index, subindex)
        if read is not None and read.data_type:
            return read
        for each in self.documented:
            if (each.index, each.subindex) == (index, subindex):
                agrees = read is None or read.bit_length in (0, each.bit_length)
                return each if agrees else read
        return read

    def known_value(self, index: int, subindex: int) -> bytes | None:
        """Return the value of a dictionary entry; None if it was not or could not be read.

        Args:
            index: The index of the object.
            subindex: The subindex of the entry.
        """
        for value in self.values:
            if (value.index, value.subindex) == (index, subindex):
                return value.data
        return None

    def __str__(self) -> str:
        return f"device {self.position} ({self.full_name})"

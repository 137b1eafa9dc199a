"""Values of an ENI file (ETG.2100). Times are in seconds; a `source` is file and line."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.esi.device import EsiPdo
from catenary.esi.source import NO_SOURCE, EsiWarning, Source
from catenary.model.device import Direction, Identity
from catenary.model.esi_settings import InitCommand
from catenary.model.register_command import RegisterCommand, Validation

__all__ = [
    "EniClock",
    "EniCyclicCommand",
    "EniDevice",
    "EniFile",
    "EniMailbox",
    "EniSyncManager",
    "ImagePart",
    "MailboxCommand",
    "RegisterCommand",
    "Validation",
    "Variable",
]


@dataclass(frozen=True, slots=True)
class MailboxCommand:
    """Mailbox request at a transition (`Mailbox/CoE/InitCmds/InitCmd`, and EoE, SoE, FoE ...)."""

    protocol: str  # "CoE", "EoE", "SoE" ...
    transitions: tuple[str, ...]
    data: bytes
    download: InitCommand | None = None  # the object of a CoE command
    operation: int = 0  # Ccs of CoE (1: download), OpCode of SoE (3: write)
    idn: int | None = None  # of SoE
    elements: int = 0  # of SoE: parts of the IDN; 0x40 is the value
    drive: int = 0  # of SoE
    disabled: bool = False
    timeout: float = 0.0
    comment: str = ""
    source: Source = NO_SOURCE

    @property
    def parameter(self) -> str:
        """IDN and drive of a SoE command, such as "P-0-0032 of drive 1"; empty for others."""
        if self.idn is None:
            return ""
        letter, group, number = "SP"[self.idn >> 15], self.idn >> 12 & 7, self.idn & 0xFFF
        return f"{letter}-{group}-{number:04d} of drive {self.drive}"


@dataclass(frozen=True, slots=True)
class ImagePart:
    """Bits of the process image that belong to one device (`ProcessData/Send`, `Recv`)."""

    bit_start: int
    bit_length: int


@dataclass(frozen=True, slots=True)
class EniSyncManager:
    """SyncManager of process data (`ProcessData/Sm2`), with its PDOs in order."""

    index: int
    direction: Direction
    start: int
    control: int
    enabled: bool
    pdos: tuple[EsiPdo, ...]
    source: Source = NO_SOURCE

    @property
    def bit_length(self) -> int:
        """Length of the PDOs [bits]."""
        return sum(pdo.bit_length for pdo in self.pdos)


@dataclass(frozen=True, slots=True)
class EniMailbox:
    """Mailbox of a device; offsets and sizes in bytes. `send` is written by the MainDevice."""

    send_start: int
    send_length: int
    receive_start: int
    receive_length: int
    protocols: tuple[str, ...]
    poll_time: float | None = None
    status_bit: int | None = None  # logical bit address of the state of SyncManager 1
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EniClock:
    """Distributed clock of a device (`DC`)."""

    reference: bool = False
    potential_reference: bool = False
    sync0: float = 0.0  # period of SYNC0; 0: off
    sync1: float = 0.0  # as in the file: time from SYNC0 to SYNC1, or its period; 0: off
    shift: float = 0.0
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EniDevice:
    """One device of the bus (`Slave`)."""

    name: str
    position: int
    station_address: int
    identity: Identity
    physics: str
    outputs: tuple[ImagePart, ...]
    inputs: tuple[ImagePart, ...]
    sync_managers: tuple[EniSyncManager, ...]
    pdos: tuple[EsiPdo, ...]
    mailbox: EniMailbox | None
    requests: tuple[MailboxCommand, ...]
    commands: tuple[RegisterCommand, ...]
    clock: EniClock | None
    previous: tuple[int, str] | None = None  # station address and port of the device before it
    source: Source = NO_SOURCE

    def image(self, direction: Direction) -> tuple[ImagePart, ...]:
        """Return the bits of the device in the image of a direction."""
        return self.outputs if direction is Direction.OUTPUT else self.inputs

    def managers(self, direction: Direction) -> tuple[EniSyncManager, ...]:
        """Return the SyncManagers of a direction that have PDOs, in order."""
        found = (each for each in self.sync_managers if each.direction is direction)
        return tuple(each for each in found if each.pdos)


@dataclass(frozen=True, slots=True)
class Variable:
    """Variable of the process image (`ProcessImage/Inputs/Variable`)."""

    name: str
    direction: Direction
    data_type: str
    bit_length: int
    bit_offset: int  # in the image of its direction
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EniCyclicCommand:
    """Datagram of the cyclic frames (`Cyclic/Frame/Cmd`)."""

    command: int
    address: int  # 32 bits as on the wire: ADP | ADO << 16, or the logical address
    length: int
    states: tuple[str, ...]
    count: int | None  # expected working counter
    input_offset: int
    output_offset: int
    comment: str = ""
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EniFile:
    """Content of an ENI file."""

    path: str
    encrypted: bool  # the root is EncryptedEtherCATConfig; its content is readable nevertheless
    commands: tuple[RegisterCommand, ...]  # of the MainDevice
    devices: tuple[EniDevice, ...]  # in the order of their positions
    cycle_time: float | None  # [s]
    cyclic: tuple[EniCyclicCommand, ...]
    variables: tuple[Variable, ...]  # inputs, then outputs
    image_sizes: tuple[int, int] = (0, 0)  # inputs, outputs [bytes]
    warnings: tuple[EsiWarning, ...] = ()

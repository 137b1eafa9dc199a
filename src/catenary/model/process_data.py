"""Process data of a SubDevice: PDOs, their entries and their assignment; dictionary entries."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum

from catenary.wire.sii_categories import SyncManagerUse


class Direction(IntEnum):
    """Direction of process data, seen from the MainDevice."""

    OUTPUT = 0  # RxPDOs
    INPUT = 1  # TxPDOs

    @property
    def use(self) -> SyncManagerUse:
        """Use of the SyncManagers that carry this direction."""
        return SyncManagerUse.OUTPUTS if self is Direction.OUTPUT else SyncManagerUse.INPUTS

    @property
    def noun(self) -> str:
        """Name of the direction in messages."""
        return "outputs" if self is Direction.OUTPUT else "inputs"


@dataclass(frozen=True, slots=True)
class Entry:
    """One object in a PDO. Index 0 marks a gap."""

    index: int
    subindex: int
    bit_length: int
    name: str = ""
    data_type: int = 0  # ETG.1000.6 table 64; 0 if unknown
    unit: str = ""  # from an ESI file
    enumeration: tuple[tuple[int, str], ...] = ()  # values with texts, from an ESI file

    @property
    def place(self) -> tuple[int, int, int]:
        """Index, subindex and bit length, by which entries are compared."""
        return self.index, self.subindex, self.bit_length

    def __str__(self) -> str:
        place = f"0x{self.index:04X}:{self.subindex:02X} ({self.bit_length} bits)"
        return f"{place} {self.name}".rstrip()


@dataclass(frozen=True, slots=True)
class Pdo:
    """A process data object: entries that are transferred together."""

    index: int
    entries: tuple[Entry, ...]
    sync_manager: int | None  # default assignment; None if not assigned
    fixed: bool = False  # its entries cannot be changed
    mandatory: bool = False  # cannot be removed from the assignment
    name: str = ""
    excludes: frozenset[int] = frozenset()  # PDOs that cannot be assigned together with it (ESI)
    excluded_sync_managers: frozenset[int] = frozenset()  # it cannot be assigned to these (ESI)
    missing: bool = False  # its ESI has it, but its dictionary does not
    sample: int = 0  # from 1 for further samples with oversampling; their entries are not written
    source: str = ""

    @property
    def bit_length(self) -> int:
        """Total length of the entries [bits]."""
        return sum(entry.bit_length for entry in self.entries)


@dataclass(frozen=True, slots=True)
class Assignment:
    """The PDOs that one SyncManager carries, in order."""

    sync_manager: int
    pdos: tuple[Pdo, ...]
    fixed: bool = False  # the list of PDOs (0x1C10 + SyncManager) cannot be changed

    @property
    def bit_length(self) -> int:
        """Total length of the PDOs [bits]."""
        return sum(pdo.bit_length for pdo in self.pdos)

    @property
    def byte_length(self) -> int:
        """Total length of the PDOs [bytes], rounded up."""
        return (self.bit_length + 7) // 8


@dataclass(frozen=True, slots=True)
class ObjectInformation:
    """Description of a dictionary entry (SDO information, ETG.1000.6 §5.6.3.6)."""

    index: int
    subindex: int
    bit_length: int
    data_type: int = 0
    output_mappable: bool = True  # as RxPDO
    input_mappable: bool = True  # as TxPDO
    name: str = ""
    note: str = ""  # the reason if the dictionary does not describe it
    readable: bool = True  # False if it is write-only according to the dictionary
    unit: str = ""  # from an ESI file
    enumeration: tuple[tuple[int, str], ...] = ()  # values with texts, from an ESI file


def mapped_pdos(assignments: Iterable[Assignment]) -> tuple[Pdo, ...]:
    """Return all PDOs of the assignments, in order."""
    return tuple(pdo for assignment in assignments for pdo in assignment.pdos)


def mapped_entries(assignments: Iterable[Assignment]) -> tuple[Entry, ...]:
    """Return all entries of the assignments, without gaps."""
    return tuple(entry for pdo in mapped_pdos(assignments) for entry in pdo.entries if entry.index)

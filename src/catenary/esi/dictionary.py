"""Object dictionary of an ESI file (ETG.2000, `Dictionary`): data types and objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from catenary.esi.source import NO_SOURCE, Source


@dataclass(frozen=True, slots=True)
class EsiArray:
    """Bounds of an array type."""

    lower_bound: int
    elements: int


@dataclass(frozen=True, slots=True)
class EsiSubItem:
    """Member of a record type, or of an array type (without subindex)."""

    name: str
    type: str
    bit_length: int
    bit_offset: int
    subindex: int | None = None  # None: counted from the order of the members
    access: str = ""  # "ro", "rw" or "wo"; empty: that of the object
    pdo_mapping: str = ""  # "R" (RxPDO), "T" (TxPDO), "RT", or empty
    category: str = ""  # "m" (mandatory), "o" (optional), "c" (conditional), or empty


@dataclass(frozen=True, slots=True)
class EsiDataType:
    """Data type that the file declares: derived type, array, record or enumeration."""

    name: str
    bit_length: int
    base: str = ""  # name of the base type of a derived type, an array or an enumeration
    arrays: tuple[EsiArray, ...] = ()
    members: tuple[EsiSubItem, ...] = ()
    enumeration: Mapping[int, str] = field(default_factory=dict)  # texts by value
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EsiObjectEntry:
    """One entry of an object: subindex 0 of a variable, or a member of an array or record."""

    index: int
    subindex: int
    name: str
    type: str  # name of the data type, as in the file
    bit_length: int
    access: str = "ro"  # "ro", "rw" or "wo"
    pdo_mapping: str = ""  # "R", "T", "RT", or empty
    default: bytes | None = None  # little endian; None if the file gives none
    minimum: bytes | None = None
    maximum: bytes | None = None
    unit: int | None = None  # unit code of ETG.1004
    enumeration: Mapping[int, str] = field(default_factory=dict)  # texts by value

    @property
    def place(self) -> str:
        """Index and subindex as text."""
        return f"0x{self.index:04X}:{self.subindex:02X}"


@dataclass(frozen=True, slots=True)
class EsiObject:
    """One object with its entries, in the order of the subindices."""

    index: int
    name: str
    type: str
    bit_length: int
    entries: tuple[EsiObjectEntry, ...]
    depends_on_slot: bool = False  # the index increases by the slot's index increment
    source: Source = NO_SOURCE


@dataclass(frozen=True, slots=True)
class EsiDictionary:
    """Data types and objects of a device or a module."""

    types: Mapping[str, EsiDataType] = field(default_factory=dict)
    objects: Mapping[int, EsiObject] = field(default_factory=dict)

    def entry(self, index: int, subindex: int = 0) -> EsiObjectEntry | None:
        """Return an entry; None if the dictionary does not have it.

        Args:
            index: Index of the object.
            subindex: Subindex of the entry.
        """
        found = self.objects.get(index)
        for entry in found.entries if found is not None else ():
            if entry.subindex == subindex:
                return entry
        return None

"""Entries of an index of ESI files: what a library knows without reading a device again."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from catenary.esi.device import DeviceKey, RevisionCheck
from catenary.esi.source import EsiWarning, Source


class Kind(StrEnum):
    """Kind of an entry."""

    DEVICE = "device"
    MODULE = "module"
    DICTIONARY = "dictionary"


@dataclass(frozen=True, slots=True)
class IndexEntry:
    """Place and identity of one device, module or dictionary file."""

    kind: Kind
    offset: int  # of the element in the file [bytes]
    length: int  # [bytes]
    line: int  # from 1
    vendor: int = 0
    product: int = 0
    revision: int = 0
    ident: int = 0  # of a module
    module_class: str = ""
    type: str = ""
    name: str = ""
    revision_check: RevisionCheck = RevisionCheck.NONE
    hides: tuple[DeviceKey, ...] = ()

    @property
    def key(self) -> DeviceKey:
        """Vendor, product and revision of a device."""
        return DeviceKey(self.vendor, self.product, self.revision)


@dataclass(frozen=True, slots=True)
class FileIndex:
    """Entries of one file, and what its devices share."""

    path: str
    encoding: str = "utf-8"
    vendor: int = 0
    vendor_name: str = ""
    entries: tuple[IndexEntry, ...] = ()
    groups: dict[str, str] = field(default_factory=dict)  # name by type
    references: tuple[str, ...] = ()  # `InfoReference`, as in the file
    warnings: tuple[EsiWarning, ...] = ()


class FileState(NamedTuple):
    """Size, time and hash by which a changed file is recognised."""

    size: int
    mtime_ns: int
    digest: str


@dataclass(frozen=True, slots=True)
class Record:
    """Entry of a library: an index entry with its file."""

    entry: IndexEntry
    path: str
    root: str  # folder that references of the file cannot leave
    order: int  # of the source in the library; the last one is preferred

    @property
    def source(self) -> Source:
        """File and line."""
        return Source(self.path, self.entry.line)

    @property
    def key(self) -> DeviceKey:
        """Vendor, product and revision of a device."""
        return self.entry.key

    def __str__(self) -> str:
        text = f"{self.entry.type} ({self.entry.name})" if self.entry.name else self.entry.type
        return f"{text}, {self.key}, {self.source}"

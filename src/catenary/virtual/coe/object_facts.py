"""Facts about the objects of a device that is described by a file: values, without behaviour."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

Place = tuple[int, int]  # index and subindex


@dataclass(frozen=True, slots=True)
class EntryFacts:
    """One entry of an object."""

    subindex: int
    name: str
    data_type: int  # CANopen data type, ETG.1020; 0 if unknown
    bits: int
    access: int  # bits 0 to 2: readable in PRE-OP, SAFE-OP and OP; 3 to 5: writable; 6, 7: mappable
    value: bytes | None = None  # None: unknown, or not readable
    abort: int = 0  # abort code of a read, if the device refuses it; 0: readable


@dataclass(frozen=True, slots=True)
class ObjectFacts:
    """One object with its entries, in the order of the subindices."""

    index: int
    name: str
    entries: tuple[EntryFacts, ...]
    code: int = 0  # 7 variable, 8 array, 9 record; 0: derived from the entries
    data_type: int = 0  # of the object
    maximum: int | None = None  # highest subindex that the object description gives; None: derived


def by_place(objects: Iterable[ObjectFacts]) -> dict[Place, EntryFacts]:
    """Return the entries by index and subindex."""
    return {(each.index, entry.subindex): entry for each in objects for entry in each.entries}

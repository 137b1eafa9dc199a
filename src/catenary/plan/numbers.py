"""Where mapped objects sit in a process image, bit by bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from catenary.model.device import Assignment, Entry, Pdo
from catenary.plan.cycle import Number, NumberKind
from catenary.types import Integer, Real, by_index


class EntryPlace(NamedTuple):
    pdo: Pdo
    entry: Entry
    bit: int  # from the start of the image


def entry_places(assignments: Sequence[Assignment], offset: int) -> Iterator[EntryPlace]:
    """All entries, gaps too, of a device whose data begins at byte `offset`. Every SyncManager
    begins at a byte of its own."""
    for assignment in assignments:
        bit = offset * 8
        for pdo in assignment.pdos:
            for entry in pdo.entries:
                yield EntryPlace(pdo, entry, bit)
                bit += entry.bit_length
        offset += assignment.byte_length


def numbers(assignments: Sequence[Assignment], offset: int) -> dict[tuple[int, int], Number]:
    """The mapped objects by (index, subindex); of one mapped twice, the first place."""
    found: dict[tuple[int, int], Number] = {}
    for _, entry, bit in entry_places(assignments, offset):
        if entry.index:
            number = Number(bit, entry.bit_length, number_kind(entry.data_type))
            found.setdefault((entry.index, entry.subindex), number)
    return found


def number_kind(data_type: int) -> NumberKind:
    """How an object of this CoE data type is read; unknown ones are unsigned."""
    try:
        kind = by_index(data_type)
    except ValueError:
        return NumberKind.UNSIGNED
    if isinstance(kind, Real):
        return NumberKind.REAL
    signed = isinstance(kind, Integer) and kind.signed
    return NumberKind.SIGNED if signed else NumberKind.UNSIGNED

"""Places of mapped objects in a process image, in bits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from catenary.model.device import Assignment, Entry, Pdo
from catenary.plan.cycle import Number, NumberKind
from catenary.types import Integer, Real, by_index


class Which(NamedTuple):
    """Selection of one place of an object that is mapped several times. 0 in a field means any."""

    pdo: int = 0
    bit_length: int = 0
    rank: int = 0  # number of the place among equal ones, from 0


ANY = Which()


class EntryPlace(NamedTuple):
    """Entry of a PDO, and its place in an image."""

    pdo: Pdo
    entry: Entry
    bit: int  # from the start of the image


def entry_places(assignments: Sequence[Assignment], offset: int) -> Iterator[EntryPlace]:
    """Yield all entries of a device, gaps included. Every SyncManager begins at a new byte.

    Args:
        assignments: SyncManagers and their PDOs.
        offset: First byte of the device in the image.
    """
    for assignment in assignments:
        bit = offset * 8
        for pdo in assignment.pdos:
            for entry in pdo.entries:
                yield EntryPlace(pdo, entry, bit)
                bit += entry.bit_length
        offset += assignment.byte_length


@dataclass(frozen=True, slots=True)
class MappedPdo:
    """One PDO in an image, with its gaps."""

    index: int
    bits: range  # from the start of the image


def mapped_pdos(assignments: Sequence[Assignment], offset: int) -> tuple[MappedPdo, ...]:
    """Return the PDOs in the order of the image.

    Args:
        assignments: SyncManagers and their PDOs.
        offset: First byte of the device in the image.
    """
    found = []
    for assignment in assignments:
        bit = offset * 8
        for pdo in assignment.pdos:
            found.append(MappedPdo(pdo.index, range(bit, bit + pdo.bit_length)))
            bit += pdo.bit_length
        offset += assignment.byte_length
    return tuple(found)


@dataclass(frozen=True, slots=True)
class MappedNumber:
    """One mapped object in an image."""

    pdo: int
    index: int
    subindex: int
    number: Number


def numbers(assignments: Sequence[Assignment], offset: int) -> tuple[MappedNumber, ...]:
    """Return the mapped objects in the order of the image, without gaps."""
    return tuple(
        MappedNumber(
            pdo.index,
            entry.index,
            entry.subindex,
            Number(bit, entry.bit_length, number_kind(entry.data_type)),
        )
        for pdo, entry, bit in entry_places(assignments, offset)
        if entry.index
    )


def find_number(
    mapped: Sequence[MappedNumber], index: int, subindex: int, which: Which
) -> Number | None:
    """Return the place of an object; None if it is not mapped.

    A field of `which` is ignored if no remaining place agrees with it.
    """
    found = [each for each in mapped if (each.index, each.subindex) == (index, subindex)]
    if not found:
        return None
    if which.bit_length:
        found = [each for each in found if each.number.bit_length == which.bit_length] or found
    if which.pdo:
        found = [each for each in found if each.pdo == which.pdo] or found
    return found[which.rank if which.rank < len(found) else 0].number


def number_kind(data_type: int) -> NumberKind:
    """Return the kind of a CoE data type; unknown types are unsigned."""
    try:
        kind = by_index(data_type)
    except ValueError:
        return NumberKind.UNSIGNED
    if isinstance(kind, Real):
        return NumberKind.REAL
    signed = isinstance(kind, Integer) and kind.signed
    return NumberKind.SIGNED if signed else NumberKind.UNSIGNED

"""Comparison of the object dictionary of a device with that of its ESI.

PDO objects (0x1600 to 0x1BFF) are compared as PDOs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from catenary.esi.device import EsiDevice
from catenary.esi.dictionary import EsiDictionary, EsiObject, EsiObjectEntry
from catenary.esi.difference import Difference, Severity, Sides, Subject
from catenary.esi.sii_process_data import type_number
from catenary.model.coe_facts import CoeFacts, EntryFacts
from catenary.types import by_index

PDO_OBJECTS = range(0x1600, 0x1C00)
FIRST_DECLARED_TYPE = 0x0040  # types from here on belong to the device, ETG.1000.6 table 64
RIGHTS = {"ro": "r", "wo": "w", "rw": "rw"}
NAMES = {right: name for name, right in RIGHTS.items()}
SHOWN = 8  # places that a summary lists
EACH_MAX = 20  # differences of entries that are reported one by one
FIRMWARE = "check whether the ESI belongs to this firmware"
# types that differ only in their name: BOOL and BIT1, USINT and BYTE or BIT8 ...
SAME_TYPE = {0x0030: 0x0001, 0x001E: 0x0005, 0x0037: 0x0005, 0x001F: 0x0006, 0x0020: 0x0007}
SAME_TYPE |= {0x002D: 0x0005, 0x002E: 0x0006, 0x002F: 0x0007}


def compare_objects(esi: EsiDevice, coe: CoeFacts) -> Iterator[Difference]:
    """Yield the differences of the object dictionary, as far as it was read.

    Args:
        esi: The ESI, with its default modules in place.
        coe: What the object dictionary gives.
    """
    dictionary = esi.dictionary
    if dictionary is None or not dictionary.objects:
        return
    expected = {index: each for index, each in dictionary.objects.items() if _compared(index)}
    if coe.indices is not None:
        yield from _indices(esi, expected, coe.indices)
    found: list[Difference] = []
    for index, each in expected.items():
        entries = coe.objects.get(index)
        if entries is not None:
            found += _entries(each, entries, dictionary)
    found.sort(key=lambda each: each.severity is Severity.INFO)  # warnings first
    yield from found[:EACH_MAX]
    if len(found) > EACH_MAX:
        yield _rest(found[EACH_MAX:])


def _compared(index: int) -> bool:
    return index not in PDO_OBJECTS


def _indices(
    esi: EsiDevice, expected: dict[int, EsiObject], found: frozenset[int]
) -> Iterator[Difference]:
    missing = sorted(set(expected) - found)
    if missing:
        yield Difference(
            Severity.WARNING,
            Subject.OBJECT,
            "objects that only the ESI has",
            Sides(_listed(missing), None, "missing"),
            expected[missing[0]].source,
            "access to them is refused",
            FIRMWARE,
        )
    further = sorted(index for index in found - set(expected) if _compared(index))
    if further:
        yield Difference(
            Severity.INFO,
            Subject.OBJECT,
            "objects that only the device has",
            Sides("missing", None, _listed(further)),
            esi.source,
            "the ESI gives no names and types for them",
        )


def _listed(indices: Sequence[int]) -> str:
    more = f" and {len(indices) - SHOWN} more" if len(indices) > SHOWN else ""
    return ", ".join(f"0x{index:04X}" for index in indices[:SHOWN]) + more


def _entries(
    each: EsiObject, found: Sequence[EntryFacts], dictionary: EsiDictionary
) -> Iterator[Difference]:
    """Yield the differences of one object. Subindex 0 of an array or record is its length."""
    own = {entry.subindex: entry for entry in found}
    missing = [entry for entry in each.entries if entry.subindex not in own]
    if missing and own:
        shown = ", ".join(f"{entry.subindex}" for entry in missing[:SHOWN])
        yield Difference(
            Severity.WARNING,
            Subject.OBJECT,
            f"0x{each.index:04X}, subindices",
            Sides(f"{shown}{' ...' if len(missing) > SHOWN else ''}", None, "missing"),
            each.source,
            "access to them is refused",
            FIRMWARE,
        )
    for entry in each.entries:
        if entry.subindex in own:
            yield from _entry(entry, own[entry.subindex], each, dictionary)


def _entry(
    entry: EsiObjectEntry, own: EntryFacts, each: EsiObject, dictionary: EsiDictionary
) -> Iterator[Difference]:
    number = type_number(entry.type, dictionary) if entry.type else 0
    if not _same_type(number, own.data_type):
        yield _difference(
            each,
            entry,
            "type",
            _type_name(number),
            _type_name(own.data_type),
            "the value is interpreted wrongly with the type of the ESI",
        )
    elif not _is_text(number) and _unequal(own.bit_length, entry.bit_length):
        yield _difference(
            each,
            entry,
            "length",
            f"{entry.bit_length} bits",
            f"{own.bit_length} bits",
            "a write with the length of the ESI is refused",
        )
    yield from _access_difference(each, entry, own)


def _access_difference(
    each: EsiObject, entry: EsiObjectEntry, own: EntryFacts
) -> Iterator[Difference]:
    """Yield the difference of the access rights. Additional rights of the device are harmless."""
    given = entry.access if entry.access in RIGHTS else "ro"
    actual = "r" * own.readable + "w" * own.writable
    if not actual or set(RIGHTS[given]) == set(actual):
        return
    lacking = set(RIGHTS[given]) - set(actual)
    reason = "the device refuses this access" if lacking else "the device allows more than its ESI"
    found = _difference(each, entry, "access", given, NAMES[actual], reason)
    yield found if lacking else replace(found, severity=Severity.INFO, advice="")


def _difference(
    each: EsiObject, entry: EsiObjectEntry, fact: str, esi: str, coe: str, reason: str
) -> Difference:
    return Difference(
        Severity.WARNING,
        Subject.OBJECT,
        f"{entry.place} ({entry.name}), {fact}",
        Sides(esi, None, coe),
        each.source,
        reason,
        FIRMWARE,
    )


def _same_type(esi: int, own: int) -> bool:
    """Return True if the types are equal, or one of them is unknown or declared by the device."""
    if not esi or not own or max(esi, own) >= FIRST_DECLARED_TYPE:
        return True
    return SAME_TYPE.get(esi, esi) == SAME_TYPE.get(own, own)


def _unequal(one: int, other: int) -> bool:
    """Return True if two lengths differ, and both are known."""
    return bool(one and other and one != other)


def _is_text(number: int) -> bool:
    """Return True for a type of variable length."""
    return number in (0x0009, 0x000A, 0x000B, 0x000F)


def _type_name(number: int) -> str:
    try:
        return by_index(number).name
    except ValueError:
        return f"type 0x{number:04X}"


def _rest(found: Sequence[Difference]) -> Difference:
    return Difference(
        Severity.WARNING,
        Subject.OBJECT,
        f"{len(found)} further differences of entries",
        Sides(", ".join(each.what.split(" ")[0] for each in found[:SHOWN]) + " ...", None, ""),
        found[0].source,
        "the dictionary of the device differs from that of the ESI",
        FIRMWARE,
    )

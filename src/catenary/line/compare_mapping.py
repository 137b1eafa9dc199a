"""Comparison of the assignment (0x1C1x) and the mapping (0x16xx, 0x1Axx) of a device."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from catenary.line.change import ABSENT, Change, Part, Severity
from catenary.line.mapping import listed_numbers
from catenary.line.sides import Sides
from catenary.line.values import ClonedDevice, ClonedObject, MappedEntry

ASSIGNMENTS = range(0x1C10, 0x1C20)
MAPPINGS = frozenset((*range(0x1600, 0x1800), *range(0x1A00, 0x1C00)))
FROM_OBJECTS = "CoE"
_UNASSIGNED = "this PDO is not assigned"


def compare_mapping(sides: Sides) -> Iterator[Change]:
    """Yield the changes of assignment and mapping, if both are from the dictionary.

    Args:
        sides: The device.
    """
    if not (sides.old.objects and sides.new.objects):
        return
    yield from _assignments(sides)
    assigned = {pdo for device in (sides.old, sides.new) for pdo in _assigned(device)}
    old, new = (_mappings(device) for device in (sides.old, sides.new))
    for index in sorted(old.keys() & new.keys()):
        if old[index] != new[index]:
            texts = _entries(old[index]), _entries(new[index])
            if index in assigned:
                yield sides.change(Part.MAPPING, f"0x{index:04X}", texts)
            else:
                yield sides.change(
                    *(Part.MAPPING, f"0x{index:04X}", texts, Severity.INFO, _UNASSIGNED)
                )


def mapped_places(*devices: ClonedDevice) -> set[tuple[int, int]]:
    """Return the index and subindex of all entries that are mapped into assigned PDOs."""
    return {
        (entry.index, entry.subindex)
        for device in devices
        for assignment in device.assignments
        for pdo in assignment.pdos
        for entry in pdo.entries
    }


def _assignments(sides: Sides) -> Iterator[Change]:
    old, new = ({} if _from_sii(each) else _by_manager(each) for each in (sides.old, sides.new))
    for manager in sorted({*old, *new}):
        place = ASSIGNMENTS.start + manager
        if not (_was_tried(sides.old, place) and _was_tried(sides.new, place)):
            continue
        texts = _numbers(old.get(manager, ())), _numbers(new.get(manager, ()))
        if texts[0] != texts[1]:
            yield sides.change(Part.ASSIGNMENT, f"SyncManager {manager}", texts)


def _from_sii(device: ClonedDevice) -> bool:
    return device.mapping_source != FROM_OBJECTS


def _by_manager(device: ClonedDevice) -> dict[int, tuple[int, ...]]:
    return {each.sync_manager: tuple(pdo.index for pdo in each.pdos) for each in device.assignments}


def _assigned(device: ClonedDevice) -> Iterator[int]:
    for each in device.assignments:
        yield from (pdo.index for pdo in each.pdos)


def _mappings(device: ClonedDevice) -> dict[int, list[int]]:
    """Return the mapped entries of all PDOs that were read."""
    return {
        each.index: listed_numbers(each)
        for each in device.objects
        if each.index in MAPPINGS and _was_read(each)
    }


def _was_tried(device: ClonedDevice, index: int) -> bool:
    """Return True if an object was read or refused, or the device does not have it."""
    found = device.object(index)
    if found is None:
        return "objects" not in device.missing
    count = found.entry(0)
    return _was_read(found) or (count is not None and count.abort is not None)


def _was_read(listing: ClonedObject) -> bool:
    """Return True if all entries that the listing counts were read or refused."""
    count = listing.entry(0)
    if count is None or count.value is None:
        return False
    entries = (listing.entry(number) for number in range(1, int.from_bytes(count.value[:1]) + 1))
    return all(
        not listing.reason if each is None else (each.value, each.abort) != (None, None)
        for each in entries
    )


def _numbers(indices: Sequence[int]) -> str:
    return ", ".join(f"0x{index:04X}" for index in indices) or ABSENT


def _entries(numbers: Sequence[int]) -> str:
    entries = (MappedEntry(n >> 16, n >> 8 & 0xFF, n & 0xFF) for n in numbers)
    return ", ".join(map(str, entries)) or "no entries"

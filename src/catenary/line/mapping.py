"""The present assignment and mapping of a device, from its objects or its SII."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.line.values import ClonedAssignment, ClonedObject, ClonedPdo, MappedEntry
from catenary.model.device import Assignment

ASSIGNMENT_BASE, SYNC_MANAGERS = 0x1C10, 16


def mapping_of_objects(objects: Sequence[ClonedObject]) -> tuple[ClonedAssignment, ...]:
    """Return the assignments of a dictionary, by SyncManager; () if it has none.

    Args:
        objects: The objects, with values.
    """
    known = {each.index: each for each in objects}
    found = []
    for channel in range(SYNC_MANAGERS):
        assigned = known.get(ASSIGNMENT_BASE + channel)
        if assigned is None:
            continue
        indices = [number & 0xFFFF for number in _listed(assigned)]
        pdos = tuple(_pdo(index, known.get(index)) for index in indices)
        found += [ClonedAssignment(channel, pdos)] if pdos else []
    return tuple(found)


def mapping_of_sii(assignments: Sequence[Assignment]) -> tuple[ClonedAssignment, ...]:
    """Return the assignments that an SII describes, by SyncManager.

    Args:
        assignments: Outputs and inputs of the description.
    """
    return tuple(
        ClonedAssignment(
            each.sync_manager,
            tuple(
                ClonedPdo(pdo.index, tuple(MappedEntry(*entry.place) for entry in pdo.entries))
                for pdo in each.pdos
            ),
        )
        for each in sorted(assignments, key=lambda each: each.sync_manager)
    )


def _pdo(index: int, mapping: ClonedObject | None) -> ClonedPdo:
    numbers = [] if mapping is None else _listed(mapping)
    entries = tuple(MappedEntry(n >> 16, n >> 8 & 0xFF, n & 0xFF) for n in numbers)
    return ClonedPdo(index, entries)


def _listed(array: ClonedObject) -> list[int]:
    """Return the numbers of an array, as many as its subindex 0 states."""
    count = array.entry(0)
    if count is None or not count.value:
        return []
    entries = [array.entry(subindex) for subindex in range(1, count.value[0] + 1)]
    return [
        int.from_bytes(each.value[:4], "little")
        for each in entries
        if each is not None and each.value
    ]

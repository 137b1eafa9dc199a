"""PDOs of a device of a clone: those of its dictionary, or else those of its SII."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from catenary.line import ClonedDevice, ClonedObject
from catenary.virtual.description import Description, MappedEntry, Pdo
from catenary.wire.sdo_information import Access

RX_MAPPINGS, TX_MAPPINGS = range(0x1600, 0x1800), range(0x1A00, 0x1C00)
WRITABLE = Access.WRITE_PRE_OP
UNASSIGNED = 0xFF
Pdos = tuple[Pdo, ...]


def cloned_pdos(device: ClonedDevice, by_sii: Description) -> tuple[Pdos, Pdos]:
    """Return the RxPDOs and TxPDOs, with the assignment of the clone.

    Args:
        device: The device.
        by_sii: Its description from the SII.
    """
    assert by_sii.facts is not None
    channels = by_sii.facts.channels
    outputs = [channel.sync_manager for channel in channels if channel.outputs]
    inputs = [channel.sync_manager for channel in channels if not channel.outputs]
    return (
        _direction(device, by_sii.rx_pdos, RX_MAPPINGS, outputs),
        _direction(device, by_sii.tx_pdos, TX_MAPPINGS, inputs),
    )


def _direction(
    device: ClonedDevice, by_sii: Pdos, mappings: range, managers: Sequence[int]
) -> Pdos:
    names = {pdo.index: pdo for pdo in by_sii}
    found = [_pdo(device, each, names) for each in device.objects if each.index in mappings]
    pdos = {pdo.index: pdo for pdo in found or by_sii}
    if not device.mapping_source:
        return tuple(pdos.values())
    assigned = dict(_assigned(device, managers))
    first = [_placed(pdos[index], manager) for index, manager in assigned.items() if index in pdos]
    rest = [_placed(pdo, UNASSIGNED) for index, pdo in pdos.items() if index not in assigned]
    return (*first, *rest)


def _assigned(device: ClonedDevice, managers: Sequence[int]) -> Iterator[tuple[int, int]]:
    """Yield the index of each assigned PDO with its SyncManager, in the order of the data."""
    for assignment in device.assignments:
        if assignment.sync_manager in managers:
            yield from ((pdo.index, assignment.sync_manager) for pdo in assignment.pdos)


def _placed(pdo: Pdo, manager: int) -> Pdo:
    mandatory = pdo.mandatory and manager != UNASSIGNED
    return Pdo(pdo.index, pdo.name, pdo.entries, manager, pdo.fixed, mandatory=mandatory)


def _pdo(device: ClonedDevice, each: ClonedObject, names: dict[int, Pdo]) -> Pdo:
    known = names.get(each.index)
    return Pdo(
        each.index,
        each.name or (known.name if known else ""),
        tuple(_entries(device, each)),
        UNASSIGNED,
        fixed=_is_fixed(each, known),
        mandatory=known is not None and known.mandatory,
    )


def _is_fixed(each: ClonedObject, known: Pdo | None) -> bool:
    """Return True if the mapping cannot be changed. Without a description, the SII decides."""
    first = each.entry(0)
    if first is not None and not (first.access or first.bit_length):
        return known is not None and known.fixed
    return first is None or not first.access & WRITABLE


def _entries(device: ClonedDevice, each: ClonedObject) -> Iterator[MappedEntry]:
    """Yield the mapped objects, with names and types of the dictionary."""
    first = each.entry(0)
    count = int.from_bytes(first.value[:1], "little") if first is not None and first.value else 0
    for subindex in range(1, count + 1):
        entry = each.entry(subindex)
        if entry is None or not entry.value:
            return
        value = int.from_bytes(entry.value[:4], "little")
        index, place, bits = value >> 16, value >> 8 & 0xFF, value & 0xFF
        mapped = device.object(index)
        named = None if mapped is None else mapped.entry(place)
        name, kind = ("", 0) if named is None else (named.name, named.data_type)
        yield MappedEntry(index, place, bits, name, kind)

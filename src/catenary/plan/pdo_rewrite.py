"""New entries for a PDO: the missing objects, or the entries that the application specified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from catenary.errors import MappingError
from catenary.model.device import DeviceDescription, Direction, Entry, Pdo, mapped_entries
from catenary.plan.pdo_mapping import (
    Mapping,
    assignment_refusal,
    available_pdos,
    check_channel,
    with_lists,
    with_pdos,
)
from catenary.plan.pdo_search import carries, pdo_names

if TYPE_CHECKING:  # request.py imports NumPy, which a scan does not need
    from catenary.plan.request import ObjectReference, WrittenPdo

ENTRIES_MAX = 254  # subindices of a mapping object, ETG.1000.6 table 75


def rewrite_refusal(
    device: DeviceDescription, direction: Direction, missing: Sequence[ObjectReference]
) -> str:
    """Return the reason why the missing objects cannot be added to a PDO; empty if possible."""
    if device.mailbox is None or not device.coe:
        return "it has no CoE mailbox to change its mapping"
    for reference in missing:
        reason = _not_mappable(device, direction, reference)
        if reason:
            return f"0x{reference.index:04X}:{reference.subindex:02X} {reason}"
        if reason := _other_length(device, direction, reference):
            return reason
    if not device.mailbox.pdo_configuration:
        return "its SII does not allow changes of PDO entries"
    if _changeable(device, direction) is None:
        pdos = device.pdos(direction)
        if not all(pdo.fixed for pdo in pdos):
            return "its assigned PDOs are fixed, and no other PDO can be assigned"
        return f"all its PDOs are fixed: {pdo_names(pdos)}" if pdos else "its PDOs are not known"
    return ""


def rewrite(
    device: DeviceDescription,
    direction: Direction,
    missing: Sequence[ObjectReference],
    required: Sequence[ObjectReference],
) -> Mapping:
    """Return the mapping with the missing objects appended to a PDO that is not fixed.

    If there is not enough room, the PDO carries only the required objects that are in no other PDO.
    """
    pdo = _changeable(device, direction)
    assert pdo is not None
    assigned = available_pdos(device, direction).assigned
    others = [other for other in assigned if other.index != pdo.index]
    new = tuple(dict.fromkeys(_entry(device, each) for each in missing))
    grown = replace(pdo, entries=pdo.entries + new)
    if len(grown.entries) > ENTRIES_MAX:
        alone = [each for each in required if not any(carries(p, each) for p in others)]
        grown = replace(pdo, entries=tuple(dict.fromkeys(_entry(device, r) for r in alone)))
    if len(others) == len(assigned):
        return with_pdos(device, direction, [*assigned, grown])
    pdos = [grown if other.index == pdo.index else other for other in assigned]
    return with_pdos(device, direction, pdos)


def write_down(
    device: DeviceDescription, direction: Direction, written: Sequence[WrittenPdo]
) -> Mapping:
    """Return the mapping of exactly these PDOs, in this order.

    The PDOs of an OpMode for a device without CoE only change the lengths of its SyncManagers.

    Raises:
        MappingError: The entries of a PDO are neither specified nor known, or the device has no
            SyncManager for them.
    """
    known = {pdo.index: pdo for pdo in device.pdos(direction)}
    lists: dict[int, list[Pdo]] = {}
    for each in written:
        if not 1 <= each.copies <= ENTRIES_MAX:
            raise MappingError(
                f"{device}: {each.source}: {each.copies} samples of PDO 0x{each.index:04X} per "
                f"cycle; 1 to {ENTRIES_MAX} PDOs can be assigned",
                hint="the OpMode of the ESI file is wrong; choose another one",
            )
        pdo = _written_pdo(device, direction, each, known)
        pdos = lists.setdefault(_channel(device, direction, each, pdo), [])
        pdos += [replace(pdo, index=pdo.index + k, sample=k) for k in range(each.copies)]
    mapping = replace(with_lists(device, direction, lists), source=_source(written))
    if not device.coe and all(each.source for each in written):
        return replace(mapping, rewritten=(), reassigned=())
    return mapping


def _source(written: Sequence[WrittenPdo]) -> str:
    """Return the sources of PDOs that an OpMode or a named mapping chose."""
    found = dict.fromkeys(each.source for each in written if each.source)
    return ", ".join(f"ESI {source}" for source in found)


def _written_pdo(
    device: DeviceDescription,
    direction: Direction,
    written: WrittenPdo,
    known: dict[int, Pdo],
) -> Pdo:
    pdo = known.get(written.index, Pdo(written.index, (), None))
    if pdo.missing:
        raise MappingError(
            f"{device}: its ESI has PDO 0x{pdo.index:04X} {pdo.name!r} ({pdo.source}), but its "
            "dictionary does not",
            hint="the ESI file is for another firmware: get the one of this revision, or choose "
            "another PDO",
        )
    if written.entries is not None:
        return replace(pdo, entries=tuple(_entry(device, entry) for entry in written.entries))
    if written.index in known:
        return pdo
    raise MappingError(
        f"{device}: neither its dictionary nor its {'ESI' if device.esi else 'SII'} has PDO "
        f"0x{written.index:04X}" + f" ({written.source})" * bool(written.source),
        hint=f"specify its entries; the device has {pdo_names(device.pdos(direction))}",
    )


def _channel(device: DeviceDescription, direction: Direction, written: WrittenPdo, pdo: Pdo) -> int:
    """Return the SyncManager for a PDO: the specified one, or the first that may carry it."""
    if written.sync_manager is not None:
        return written.sync_manager
    first = check_channel(device, direction)
    if first not in pdo.excluded_sync_managers:
        return first
    for manager in device.sync_managers:
        if manager.use is direction.use and manager.index not in pdo.excluded_sync_managers:
            return manager.index
    return first


def _changeable(device: DeviceDescription, direction: Direction) -> Pdo | None:
    """Return the first PDO that is not fixed: an assigned one, otherwise an assignable one."""
    assigned, offered, _ = available_pdos(device, direction)
    if assignment_refusal(device, direction):
        offered = ()
    taken = {pdo.index for pdo in assigned}
    unassigned = [pdo for pdo in offered if pdo.index not in taken]
    return next((pdo for pdo in (*assigned, *unassigned) if not pdo.fixed), None)


def _not_mappable(
    device: DeviceDescription, direction: Direction, reference: ObjectReference
) -> str:
    """Return the reason in the dictionary why an object cannot be mapped; empty if there is none.

    An object that was not read is accepted. If it cannot be mapped, the device refuses it before
    SAFE-OP.
    """
    known = device.known_object(reference.index, reference.subindex)
    if known is None:
        return ""
    if known.bit_length == 0:
        return "does not exist in its object dictionary"
    mappable = known.output_mappable if direction is Direction.OUTPUT else known.input_mappable
    if not mappable:
        return "exists but cannot be mapped"
    if known.bit_length != reference.bit_length:
        return f"has {known.bit_length} bits, but {reference.bit_length} were requested"
    return ""


def _other_length(
    device: DeviceDescription, direction: Direction, reference: ObjectReference
) -> str:
    """Return the reason if the object is already mapped with another length; otherwise empty."""
    for entry in mapped_entries(device.assignments(direction)):
        if (entry.index, entry.subindex) == (reference.index, reference.subindex):
            place = f"0x{entry.index:04X}:{entry.subindex:02X}"
            return f"{place} is already mapped with {entry.bit_length} bits"
    return ""


def _entry(device: DeviceDescription, reference: ObjectReference) -> Entry:
    """Return the entry, with its name and type if the dictionary or a PDO contains them."""
    known = device.documented_object(reference.index, reference.subindex)
    if known is not None:
        return Entry(*reference.place, known.name, known.data_type, known.unit, known.enumeration)
    for pdo in (*device.output_pdos, *device.input_pdos):
        for entry in pdo.entries:
            if entry.place == reference.place:
                return entry
    return Entry(*reference.place)

"""Which PDOs carry what was wished for: keep the device's own, assign others, or rewrite one.

The order of preference changes least: what is assigned already; another PDO the device offers;
new entries at the end of a PDO that may be changed; such a PDO with the wished entries alone
(where there is no room). ETG.1000.6 §5.6.7.4 (0x1600, 0x1A00, 0x1C12, 0x1C13).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NoReturn

from catenary.errors import MappingError
from catenary.model.device import (
    Assignment,
    DeviceDescription,
    Direction,
    Entry,
    Pdo,
    mapped_entries,
)

if TYPE_CHECKING:  # wish.py needs NumPy, a scan does not
    from catenary.plan.wish import ObjectReference

ENTRIES_MAX = 254  # subindices of a mapping object, ETG.1000.6 table 75
BITS_MAX = 1486 * 8  # a device's data must fit one datagram of one frame


@dataclass(frozen=True, slots=True)
class Mapping:
    """The process data of one device in one direction, and what must be written to get it."""

    assignments: tuple[Assignment, ...]
    rewritten: tuple[Pdo, ...] = ()  # whose entries change
    reassigned: tuple[int, ...] = ()  # SyncManagers whose list of PDOs changes

    @property
    def changed(self) -> bool:
        return bool(self.rewritten or self.reassigned)


def make_mapping(
    device: DeviceDescription, direction: Direction, wished: Sequence[ObjectReference]
) -> Mapping:
    """The mapping that carries all objects wished for, or the required ones and as many others as
    can be; MappingError says which of the required cannot."""
    kept = [reference for reference in wished if reference.required]
    try:
        return _carrying(device, direction, wished)
    except MappingError:
        if len(kept) == len(wished):
            raise
    mapping = _carrying(device, direction, kept)
    for reference in wished:
        if not reference.required:
            with suppress(MappingError):
                mapping = _carrying(device, direction, [*kept, reference])
                kept.append(reference)
    return mapping


def _carrying(
    device: DeviceDescription, direction: Direction, wished: Sequence[ObjectReference]
) -> Mapping:
    current = Mapping(device.assignments(direction))
    missing = _missing(device, direction, current.assignments, wished)
    if not missing:
        return current
    offered = _assign_offered(device, direction, missing)
    if offered is not None:
        return _checked(device, direction, offered)
    for reference in missing:
        _check_mappable(device, direction, reference)
    return _checked(device, direction, _rewrite(device, direction, missing, wished))


def _missing(
    device: DeviceDescription,
    direction: Direction,
    assignments: Sequence[Assignment],
    wished: Sequence[ObjectReference],
) -> tuple[ObjectReference, ...]:
    there = {(entry.index, entry.subindex): entry for entry in mapped_entries(assignments)}
    missing: dict[tuple[int, int], ObjectReference] = {}
    for reference in wished:
        entry = there.get((reference.index, reference.subindex))
        if entry is None:
            missing.setdefault((reference.index, reference.subindex), reference)
        elif entry.bit_length != reference.bit_length:
            _refuse(
                device,
                direction,
                reference,
                f"is mapped with {entry.bit_length} bits, {reference.bit_length} were wished",
                "wish for the object with the length the device gives it",
            )
    return tuple(missing.values())


def _assign_offered(
    device: DeviceDescription, direction: Direction, missing: Sequence[ObjectReference]
) -> Mapping | None:
    """Adds PDOs that the device offers with just such entries. None: they do not carry all."""
    if not device.coe:
        return None
    assigned = {pdo.index for a in device.assignments(direction) for pdo in a.pdos}
    added: list[Pdo] = []
    for reference in missing:
        if any(_carries(pdo, reference) for pdo in added):
            continue
        offers = (p for p in device.pdos(direction) if p.index not in assigned)
        offer = next((p for p in offers if _carries(p, reference)), None)
        if offer is None:
            return None
        added.append(offer)
    channel = _process_data_channel(device, direction)
    others = tuple(a for a in device.assignments(direction) if a.sync_manager != channel)
    pdos = _assigned_to(device, direction, channel) + tuple(added)
    duplicates = _twice(pdos)
    if duplicates:
        return None
    return Mapping(_in_order((*others, Assignment(channel, pdos))), reassigned=(channel,))


def _rewrite(
    device: DeviceDescription,
    direction: Direction,
    missing: Sequence[ObjectReference],
    wished: Sequence[ObjectReference],
) -> Mapping:
    """Appends the missing entries to a PDO that may be changed, or makes it carry them alone."""
    if not device.coe:
        _refuse(
            device,
            direction,
            missing[0],
            "is not mapped, and the device has no CoE mailbox to change its mapping",
            _possible(device, direction),
        )
    channel = _process_data_channel(device, direction)
    assigned = _assigned_to(device, direction, channel)
    pdo = _changeable(device, direction, assigned)
    if pdo is None:
        _refuse(
            device,
            direction,
            missing[0],
            "is not mapped, and all PDOs of the device are fixed",
            _possible(device, direction),
        )
    grown = replace(pdo, entries=pdo.entries + tuple(_entry(device, r) for r in missing))
    if len(grown.entries) > ENTRIES_MAX:
        elsewhere = {
            (entry.index, entry.subindex)
            for other in assigned
            if other.index != pdo.index
            for entry in other.entries
        }
        alone = [r for r in wished if (r.index, r.subindex) not in elsewhere]
        grown = replace(pdo, entries=tuple(_entry(device, r) for r in alone))
    is_assigned = any(other.index == pdo.index for other in assigned)
    pdos = tuple(grown if other.index == pdo.index else other for other in assigned)
    if not is_assigned:
        pdos = (*pdos, grown)
    others = tuple(a for a in device.assignments(direction) if a.sync_manager != channel)
    return Mapping(
        _in_order((*others, Assignment(channel, pdos))),
        rewritten=(grown,),
        reassigned=() if is_assigned else (channel,),
    )


def _changeable(
    device: DeviceDescription, direction: Direction, assigned: Sequence[Pdo]
) -> Pdo | None:
    """The assigned PDO that may be changed; else one that could be assigned."""
    unassigned = [p for p in device.pdos(direction) if p.index not in {a.index for a in assigned}]
    candidates = [*assigned, *unassigned]
    return next((pdo for pdo in candidates if not pdo.fixed), None)


def _entry(device: DeviceDescription, reference: ObjectReference) -> Entry:
    known = device.known_object(reference.index, reference.subindex)
    if known is None:
        return Entry(reference.index, reference.subindex, reference.bit_length)
    return Entry(
        reference.index, reference.subindex, reference.bit_length, known.name, known.data_type
    )


def _check_mappable(
    device: DeviceDescription, direction: Direction, reference: ObjectReference
) -> None:
    """What has been asked of the dictionary must agree. An object never asked for is left to the
    device, which refuses it when its mapping is written, before SAFE-OP."""
    known = device.known_object(reference.index, reference.subindex)
    if known is None:
        return
    if known.bit_length == 0:
        _refuse(
            device,
            direction,
            reference,
            "does not exist in its object dictionary",
            _possible(device, direction),
        )
    mappable = known.output_mappable if direction is Direction.OUTPUT else known.input_mappable
    if not mappable:
        _refuse(
            device,
            direction,
            reference,
            "exists but cannot be mapped",
            "read or write it by SDO instead",
        )
    if known.bit_length != reference.bit_length:
        _refuse(
            device,
            direction,
            reference,
            f"has {known.bit_length} bits, {reference.bit_length} were wished",
            "wish for the object with the length the device gives it",
        )


def _checked(device: DeviceDescription, direction: Direction, mapping: Mapping) -> Mapping:
    for assignment in mapping.assignments:
        if assignment.bit_length > BITS_MAX:
            raise MappingError(
                f"{device}: {assignment.byte_length} bytes of {direction.noun} in SyncManager "
                f"{assignment.sync_manager} do not fit a datagram of {BITS_MAX // 8} bytes",
                hint="wish for fewer objects",
            )
    return mapping


def _process_data_channel(device: DeviceDescription, direction: Direction) -> int:
    """The SyncManager that process data of a direction goes through."""
    for assignment in device.assignments(direction):
        return assignment.sync_manager
    for channel in device.sync_managers:
        if channel.use is direction.use:
            return channel.index
    raise MappingError(
        f"{device} has no SyncManager for {direction.noun}",
        hint="do not wish for process data of this direction from this device",
    )


def _assigned_to(device: DeviceDescription, direction: Direction, channel: int) -> tuple[Pdo, ...]:
    for assignment in device.assignments(direction):
        if assignment.sync_manager == channel:
            return assignment.pdos
    return ()


def _carries(pdo: Pdo, reference: ObjectReference) -> bool:
    wanted = (reference.index, reference.subindex, reference.bit_length)
    return any((e.index, e.subindex, e.bit_length) == wanted for e in pdo.entries)


def _twice(pdos: Sequence[Pdo]) -> bool:
    """Whether an object would be mapped twice: PDOs that exclude each other look like that."""
    places = [(e.index, e.subindex) for pdo in pdos for e in pdo.entries if e.index]
    return len(places) != len(set(places))


def _in_order(assignments: Sequence[Assignment]) -> tuple[Assignment, ...]:
    return tuple(sorted(assignments, key=lambda assignment: assignment.sync_manager))


def _possible(device: DeviceDescription, direction: Direction) -> str:
    objects = sorted(
        {
            f"0x{entry.index:04X}:{entry.subindex:02X}"
            for pdo in device.pdos(direction)
            for entry in pdo.entries
            if entry.index
        }
    )
    if not objects:
        return f"the device has no mappable {direction.noun}"
    shown = ", ".join(objects[:12]) + (" ..." if len(objects) > 12 else "")
    return f"its PDOs for {direction.noun} offer {shown}"


def _refuse(
    device: DeviceDescription,
    direction: Direction,
    reference: ObjectReference,
    reason: str,
    hint: str,
) -> NoReturn:
    raise MappingError(
        f"{device}: object 0x{reference.index:04X}:{reference.subindex:02X} "
        f"({reference.bit_length} bits), wished for as one of its {direction.noun}, {reason}",
        hint=hint,
    )

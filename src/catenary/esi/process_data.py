"""PDOs, their assignment and SyncManagers: the ESI of a device combined with its description.

The order of trust is: what the device reports (CoE), then the ESI, then the SII. A mapping that
was read from the device is kept, and only gets names, types and rules. Otherwise, the PDOs and the
default assignment of the ESI (`Sm`) replace those of the SII.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.esi.device import EsiDevice, EsiEntry, EsiPdo, EsiSyncManager
from catenary.esi.object_descriptions import data_type_index, enumeration_of
from catenary.esi.units import unit_text
from catenary.model.describe import assignments
from catenary.model.device import (
    Assignment,
    DeviceDescription,
    Direction,
    Entry,
    Pdo,
    SyncManager,
)
from catenary.wire.sync_manager import WATCHDOG_TRIGGER

MEMORY_START = 0x1000  # ETG.1000.4 §6.1: registers below
READ_SOURCES = ("CoE", "IgH master")  # of a mapping that was read from the device


def with_process_data(device: DeviceDescription, esi: EsiDevice) -> DeviceDescription:
    """Return the description with the PDOs of an ESI. Notes name contradictions to the SII.

    Args:
        device: Description of the device.
        esi: Its ESI.
    """
    was_read = device.mapping_source in READ_SOURCES
    if device.mapping_source != "IgH master":  # it chooses the SyncManagers itself
        device = _with_sync_managers(device, esi)
    for direction in Direction:
        described = esi.pdos_of(direction)
        if not described:
            continue
        if was_read:
            device = _completed(device, direction, esi, described)
        else:
            device = _replaced(device, direction, esi, described)
    if not was_read and esi.pdos:
        device = replace(device, mapping_source=f"ESI {esi.source}")
    return device


def _completed(
    device: DeviceDescription, direction: Direction, esi: EsiDevice, described: Sequence[EsiPdo]
) -> DeviceDescription:
    """Return the description with its own mapping, and with the PDOs that the ESI adds."""
    rules = {pdo.index: pdo for pdo in described}
    known = {pdo.index: _named(esi, pdo, rules.get(pdo.index)) for pdo in device.pdos(direction)}
    added = [model_pdo(esi, pdo, None) for pdo in described if pdo.index not in known]
    assigned = tuple(
        replace(each, pdos=tuple(_named(esi, pdo, rules.get(pdo.index)) for pdo in each.pdos))
        for each in device.assignments(direction)
    )
    return device.with_process_data(direction, assigned, (*known.values(), *added))


def _replaced(
    device: DeviceDescription, direction: Direction, esi: EsiDevice, described: Sequence[EsiPdo]
) -> DeviceDescription:
    """Return the description with the PDOs and the default assignment of the ESI."""
    usable = {each.index for each in device.sync_managers if each.use is direction.use}
    before = {pdo.index: pdo for pdo in device.pdos(direction)}
    pdos, notes = [], []
    for each in described:
        channel = each.sync_manager
        if channel is not None and channel not in usable:
            notes.append(
                f"{each.source}: its ESI assigns PDO 0x{each.index:04X} to SyncManager {channel}, "
                f"which does not carry {direction.noun}"
            )
            channel = None
        old = before.pop(each.index, None)
        pdos.append(_with_old_names(model_pdo(esi, each, channel), old))
    pdos += [replace(pdo, sync_manager=None) for pdo in before.values()]
    assigned = assignments(tuple(pdos))
    if not device.coe:  # otherwise, the mapping that the device reports counts
        notes += _differences(device, direction, assigned, esi)
    device = device.with_process_data(direction, assigned, tuple(pdos))
    return replace(device, notes=(*device.notes, *notes))


def _differences(
    device: DeviceDescription,
    direction: Direction,
    assigned: tuple[Assignment, ...],
    esi: EsiDevice,
) -> list[str]:
    if not device.pdos(direction):
        return []
    now, then = _text(assigned), _text(device.assignments(direction))
    if now == then:
        return []
    return [
        f"{esi.source}: its ESI assigns the {direction.noun} {now}, its SII {then}; those of the "
        "ESI are used"
    ]


def _text(assigned: tuple[Assignment, ...]) -> str:
    parts = [
        f"SyncManager {each.sync_manager}: "
        + ", ".join(f"0x{pdo.index:04X} ({pdo.bit_length} bits)" for pdo in each.pdos)
        for each in assigned
    ]
    return "; ".join(parts) or "none"


def model_pdo(esi: EsiDevice, described: EsiPdo, channel: int | None) -> Pdo:
    """Return a PDO of an ESI as a value of the model.

    Args:
        esi: Device or module with the dictionary that names the entries.
        described: The PDO.
        channel: SyncManager to which it is assigned; None: not assigned.
    """
    return Pdo(
        described.index,
        tuple(_entry(esi, each) for each in described.entries),
        channel,
        fixed=described.fixed,
        mandatory=described.mandatory,
        name=described.name,
        excludes=described.excludes,
        excluded_sync_managers=described.excluded_sync_managers,
        source=str(described.source),
    )


def _named(esi: EsiDevice, pdo: Pdo, described: EsiPdo | None) -> Pdo:
    """Return a PDO of the device with the names and rules of the ESI."""
    if described is None:
        entries = {
            (each.index, each.subindex): each for each in map(lambda e: _bare(esi, e), pdo.entries)
        }
        return replace(pdo, entries=tuple(_joined(e, entries) for e in pdo.entries))
    other = model_pdo(esi, described, pdo.sync_manager)
    entries = {(each.index, each.subindex): each for each in other.entries if each.index}
    return replace(
        other,
        entries=tuple(_joined(entry, entries) for entry in pdo.entries),
        name=pdo.name or other.name,
        fixed=pdo.fixed or other.fixed,
    )


def _bare(esi: EsiDevice, entry: Entry) -> Entry:
    """Return an entry that no PDO of the ESI has, as its dictionary describes it."""
    return _entry(esi, EsiEntry(entry.index, entry.subindex, entry.bit_length))


def _joined(entry: Entry, described: dict[tuple[int, int], Entry]) -> Entry:
    """Return an entry with the facts of the ESI that the device does not report."""
    other = described.get((entry.index, entry.subindex))
    if other is None or not entry.index:
        return entry
    unnamed = entry.name in ("", f"0x{entry.index:04X}:{entry.subindex:02X}")
    same = entry.bit_length == other.bit_length
    return replace(
        entry,
        name=other.name or entry.name if unnamed else entry.name,
        data_type=entry.data_type or other.data_type * same,
        unit=other.unit,
        enumeration=other.enumeration,
    )


def _with_old_names(pdo: Pdo, old: Pdo | None) -> Pdo:
    """Return a PDO of the ESI with the names and types that only the SII has."""
    if old is None:
        return pdo
    entries = {each.place: each for each in old.entries if each.index}
    filled = tuple(
        replace(
            each,
            name=each.name or entries[each.place].name,
            data_type=each.data_type or entries[each.place].data_type,
        )
        if each.place in entries
        else each
        for each in pdo.entries
    )
    return replace(pdo, name=pdo.name or old.name, entries=filled)


def _entry(esi: EsiDevice, described: EsiEntry) -> Entry:
    known = None
    if esi.dictionary is not None and described.index:
        known = esi.dictionary.entry(described.index, described.subindex)
    kind = described.type or ("" if known is None else known.type)
    return Entry(
        described.index,
        described.subindex,
        described.bit_length,
        described.name or ("" if known is None else known.name),
        data_type_index(kind, described.bit_length, esi.dictionary) if described.index else 0,
        unit="" if known is None else unit_text(known.unit),
        enumeration=() if known is None else enumeration_of(known, esi.dictionary),
    )


def _with_sync_managers(device: DeviceDescription, esi: EsiDevice) -> DeviceDescription:
    """Return the description with the SyncManagers of the ESI.

    Those of the mailbox stay as in the SII, because the device was reached through them.
    """
    count = device.controller.sync_manager_count
    described = {each.index: each for each in esi.sync_managers if not count or each.index < count}
    present = {each.index for each in device.sync_managers}
    managers, notes = [], []
    for given in tuple(described.values()):
        if _is_misplaced(given, given.index in present):
            del described[given.index]
            notes.append(
                f"{given.source}: its ESI places SyncManager {given.index} at 0x{given.start:04X}, "
                f"but process data start at 0x{MEMORY_START:04X}; it is not used"
            )
    for each in device.sync_managers:
        other = described.get(each.index)
        changed = each if other is None else _sync_manager(other, each)
        if changed != each and _place(changed) != _place(each):
            notes.append(
                f"{esi.source}: SyncManager {each.index} is {_place(each)} in its SII, but "
                f"{_place(changed)} in its ESI, which is used"
            )
        managers.append(changed)
    managers += [_added(each) for index, each in described.items() if index not in present]
    managers.sort(key=lambda manager: manager.index)
    return replace(device, sync_managers=tuple(managers), notes=(*device.notes, *notes))


def _is_misplaced(described: EsiSyncManager, is_present: bool) -> bool:
    """Return True if process data would be in the registers of the controller."""
    if described.use not in {direction.use for direction in Direction}:
        return False
    return described.start < MEMORY_START and not (is_present and described.start == 0)


def _sync_manager(described: EsiSyncManager, present: SyncManager) -> SyncManager:
    data = {direction.use for direction in Direction}
    if described.use not in data or present.use not in data:
        return present
    return SyncManager(
        present.index,
        described.use,
        described.start or present.start,
        described.default_size or present.length,
        described.control or present.control,
        described.enabled,
        str(described.source),
    )


def _added(described: EsiSyncManager) -> SyncManager:
    return SyncManager(
        described.index,
        described.use,
        described.start,
        described.default_size,
        described.control,
        described.enabled,
        str(described.source),
    )


def _place(manager: SyncManager) -> str:
    control = manager.control & ~WATCHDOG_TRIGGER  # the plan sets this bit itself
    return f"{manager.use.name.lower()} at 0x{manager.start:04X}, control 0x{control:02X}"

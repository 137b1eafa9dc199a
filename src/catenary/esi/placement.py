"""Places of modules in the slots of a modular device (ETG.5001), and the indices there.

Each instance of a `Slot` counts as one slot; the instances are numbered consecutively from 0. A
slot adds its number times the increment to the indices that depend on it (`DependOnSlot`). A slot
without an increment of its own uses that of the device.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from catenary.esi.device import (
    EsiDevice,
    EsiEntry,
    EsiInitCommand,
    EsiModule,
    EsiPdo,
    EsiSlot,
    EsiSlots,
)
from catenary.esi.dictionary import EsiDictionary, EsiObject

SLOTS_MAX = 255  # subindices of 0xF030
INDEX_MAX = 0xFFFF


class SlotPlace(NamedTuple):
    """One slot of a device, and what it adds to the indices of its module."""

    number: int  # from 0
    slot: EsiSlot
    instance: int  # of the `Slot`, from 0
    pdo_offset: int
    index_offset: int

    @property
    def required(self) -> bool:
        """True if the slot must have a module (`MinInstances`)."""
        return self.instance < self.slot.min_instances

    @property
    def name(self) -> str:
        """Name of the slot; with its instance from 1 if there are several."""
        many = self.slot.max_instances > 1 and self.slot.name
        return f"{self.slot.name} {self.instance + 1}" if many else self.slot.name

    def __str__(self) -> str:
        return f"slot {self.number} ({self.name})" if self.name else f"slot {self.number}"


class Placement(NamedTuple):
    """A module in a slot."""

    module: EsiModule
    place: SlotPlace


def slot_places(slots: EsiSlots) -> Iterator[SlotPlace]:
    """Yield all slots of a device, in their order; at most `MaxSlotCount` and 255."""
    count = min(SLOTS_MAX, slots.max_slot_count or SLOTS_MAX)
    number = 0
    for slot in slots.slots:
        pdo = slots.pdo_increment if slot.pdo_increment is None else slot.pdo_increment
        index = slots.index_increment if slot.index_increment is None else slot.index_increment
        for instance in range(min(max(slot.max_instances, slot.min_instances), count - number)):
            yield SlotPlace(number, slot, instance, number * pdo, number * index)
            number += 1


def accepts(slot: EsiSlot, module: EsiModule) -> bool:
    """Return True if a slot accepts a module, by its ident or its class.

    Args:
        slot: The slot. One that names neither idents nor classes accepts every module.
        module: The module.
    """
    return slot.accepts(module.ident, module.module_class)


def accepted_by(device: EsiDevice, slot: EsiSlot) -> tuple[EsiModule, ...]:
    """Return the modules that a slot accepts, in the order of the file.

    Args:
        device: The device with its modules.
        slot: One of its slots.
    """
    return tuple(module for module in device.modules if accepts(slot, module))


def default_placements(device: EsiDevice) -> tuple[Placement, ...]:
    """Return the default modules of a device with their places."""
    if device.slots is None:
        return ()
    modules = {module.ident: module for module in device.modules}
    found = []
    for place in slot_places(device.slots):
        ident = place.slot.default_ident
        module = None if ident is None else modules.get(ident)
        if module is not None and place.instance < max(place.slot.min_instances, 1):
            found.append(Placement(module, place))
    return tuple(each for each in found if fits(each))


def fits(placed: Placement) -> bool:
    """Return True if all indices of a module in its slot are valid."""
    return all(index <= INDEX_MAX for index in _indices(placed_module(placed)))


def placed_module(placed: Placement) -> EsiModule:
    """Return a module with the indices that it has in its slot."""
    module, place = placed
    return replace(
        module,
        pdos=tuple(_pdo(each, place) for each in module.pdos),
        init_commands=tuple(_command(each, place) for each in module.init_commands),
        dictionary=None if module.dictionary is None else _dictionary(module.dictionary, place),
    )


def with_placements(device: EsiDevice, placed: tuple[Placement, ...]) -> EsiDevice:
    """Return a device with the PDOs, objects and commands of modules, and without slots.

    PDOs and commands of the device give way to those of a module (`OverwrittenByModule`).

    Args:
        device: The device.
        placed: Its modules with their places; the device is returned unchanged without any.
    """
    if not placed:
        return device
    modules = [placed_module(each) for each in placed]
    by_group = sorted(modules, key=lambda each: each.pdo_group)  # otherwise by slot
    pdos = [pdo for each in by_group for pdo in each.pdos]
    indices = {pdo.index for pdo in pdos}
    own = (p for p in device.pdos if not (p.overwritten_by_module and p.index in indices))
    mailbox = device.mailbox
    if mailbox is not None:
        added = [command for each in modules for command in each.init_commands]
        places = {(each.index, each.subindex) for each in added}
        kept = (
            each
            for each in mailbox.init_commands
            if not (each.overwritten_by_module and (each.index, each.subindex) in places)
        )
        mailbox = replace(mailbox, init_commands=(*kept, *added))
    return replace(
        device,
        pdos=(*own, *pdos),
        dictionary=_joined(device.dictionary, modules),
        mailbox=mailbox,
        slots=None,
    )


def _joined(own: EsiDictionary | None, modules: list[EsiModule]) -> EsiDictionary | None:
    added = [each.dictionary for each in modules if each.dictionary is not None]
    if not added:
        return own
    own = own or EsiDictionary()
    types, objects = dict(own.types), dict(own.objects)
    for each in added:
        types |= each.types
        objects |= each.objects
    return EsiDictionary(types, objects)


def _indices(module: EsiModule) -> Iterator[int]:
    for pdo in module.pdos:
        yield pdo.index
        yield from (entry.index for entry in pdo.entries)
    yield from (command.index for command in module.init_commands)
    yield from module.dictionary.objects if module.dictionary is not None else ()


def _pdo(pdo: EsiPdo, place: SlotPlace) -> EsiPdo:
    excludes = pdo.excludes
    if pdo.excludes_depend_on_slot:
        excludes = frozenset(index + place.pdo_offset for index in excludes)
    return replace(
        pdo,
        index=pdo.index + place.pdo_offset * pdo.depends_on_slot,
        entries=tuple(_entry(entry, place) for entry in pdo.entries),
        excludes=excludes,
    )


def _entry(entry: EsiEntry, place: SlotPlace) -> EsiEntry:
    if not entry.depends_on_slot or entry.index == 0:
        return entry
    return replace(entry, index=entry.index + place.index_offset)


def _command(command: EsiInitCommand, place: SlotPlace) -> EsiInitCommand:
    return replace(command, index=command.index + place.index_offset * command.depends_on_slot)


def _dictionary(dictionary: EsiDictionary, place: SlotPlace) -> EsiDictionary:
    moved = (_object(each, place) for each in dictionary.objects.values())
    return EsiDictionary(dictionary.types, {each.index: each for each in moved})


def _object(described: EsiObject, place: SlotPlace) -> EsiObject:
    offset = place.index_offset * described.depends_on_slot
    entries = tuple(replace(each, index=each.index + offset) for each in described.entries)
    return replace(described, index=described.index + offset, entries=entries)

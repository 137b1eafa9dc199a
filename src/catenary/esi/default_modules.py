"""Modular device with the modules of its default configuration (ETG.5001, MDP)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from catenary.esi.device import EsiDevice, EsiEntry, EsiInitCommand, EsiModule, EsiPdo, EsiSlots
from catenary.esi.dictionary import EsiDictionary, EsiObject

INSTANCES_MAX = 255  # of one slot


class Placement(NamedTuple):
    """A module in a slot, and what the slot adds to its indices."""

    module: EsiModule
    pdo_offset: int
    index_offset: int


def with_default_modules(device: EsiDevice) -> EsiDevice:
    """Return the device with the PDOs, objects and commands of its default modules.

    A device without slots, or without default modules, is returned unchanged.
    """
    if device.slots is None:
        return device
    placed = tuple(default_placements(device, device.slots))
    if not placed:
        return device
    dictionaries = [each.module.dictionary for each in placed if each.module.dictionary]
    dictionary = device.dictionary or (EsiDictionary() if dictionaries else None)
    if dictionary is not None:
        types, objects = dict(dictionary.types), dict(dictionary.objects)
        for each in placed:
            if each.module.dictionary is not None:
                types |= each.module.dictionary.types
                objects |= {o.index: o for o in _objects(each.module.dictionary, each)}
        dictionary = EsiDictionary(types, objects)
    mailbox = device.mailbox
    if mailbox is not None:
        commands = tuple(command for each in placed for command in _commands(each))
        mailbox = replace(mailbox, init_commands=(*mailbox.init_commands, *commands))
    pdos = (*device.pdos, *(pdo for each in placed for pdo in _pdos(each)))
    return replace(device, pdos=pdos, dictionary=dictionary, mailbox=mailbox, slots=None)


def default_placements(device: EsiDevice, slots: EsiSlots) -> Iterator[Placement]:
    """Yield the default modules with their places. Each instance of a slot counts as a slot.

    Args:
        device: The device with its modules.
        slots: Its slots.
    """
    modules = {module.ident: module for module in device.modules}
    number = 0
    for slot in slots.slots:
        module = modules.get(slot.default_ident) if slot.default_ident is not None else None
        pdo = slots.pdo_increment if slot.pdo_increment is None else slot.pdo_increment
        index = slots.index_increment if slot.index_increment is None else slot.index_increment
        wanted = min(max(slot.min_instances, 1), slot.max_instances, INSTANCES_MAX)
        for place in range(wanted if module is not None else 0):
            if module is not None and (number + place) * max(pdo, index) <= 0xFFFF:
                yield Placement(module, (number + place) * pdo, (number + place) * index)
        number += slot.max_instances


def _pdos(placed: Placement) -> Iterator[EsiPdo]:
    for pdo in placed.module.pdos:
        excludes = pdo.excludes
        if pdo.excludes_depend_on_slot:
            excludes = frozenset(index + placed.pdo_offset for index in excludes)
        yield replace(
            pdo,
            index=pdo.index + (placed.pdo_offset if pdo.depends_on_slot else 0),
            entries=tuple(_entry(entry, placed) for entry in pdo.entries),
            excludes=excludes,
        )


def _entry(entry: EsiEntry, placed: Placement) -> EsiEntry:
    if not entry.depends_on_slot or entry.index == 0:
        return entry
    return replace(entry, index=entry.index + placed.index_offset)


def _commands(placed: Placement) -> Iterator[EsiInitCommand]:
    for command in placed.module.init_commands:
        offset = placed.index_offset if command.depends_on_slot else 0
        yield replace(command, index=command.index + offset)


def _objects(dictionary: EsiDictionary, placed: Placement) -> Iterator[EsiObject]:
    for each in dictionary.objects.values():
        offset = placed.index_offset if each.depends_on_slot else 0
        entries = tuple(replace(entry, index=entry.index + offset) for entry in each.entries)
        yield replace(each, index=each.index + offset, entries=entries)

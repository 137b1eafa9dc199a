"""Modules of a modular device (ETG.5001) as values of the model, and as a part of a description."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.errors import ConfigurationError
from catenary.esi.device import EsiDevice, EsiPdo
from catenary.esi.module_choice import ModuleName, check_indices, choose_modules
from catenary.esi.object_descriptions import documented_objects
from catenary.esi.placement import (
    Placement,
    accepts,
    default_placements,
    placed_module,
    slot_places,
)
from catenary.esi.process_data import READ_SOURCES, model_pdo
from catenary.esi.settings import init_command
from catenary.model.device import DeviceDescription, Direction, Pdo
from catenary.model.module import (
    CONFIGURED_IDENTS,
    DEFAULTS,
    DETECTED_IDENTS,
    ConfiguredModule,
    ModularDevice,
)
from catenary.model.module_mapping import with_mapping_of, with_modules


def expand(device: EsiDevice, choice: Sequence[ModuleName | None]) -> tuple[ConfiguredModule, ...]:
    """Return the modules that an application chose, with the indices of their slots.

    Args:
        device: Modular device with its modules.
        choice: Module of each slot, in order: name, type or ident; None for an empty slot.

    Raises:
        ConfigurationError: A module cannot be used in its slot. The message names both.
        TypeError: `choice` is not a list of names and idents.
    """
    return configured(device, choose_modules(device, choice))


def configured(device: EsiDevice, placed: Sequence[Placement]) -> tuple[ConfiguredModule, ...]:
    """Return modules as values of the model.

    Args:
        device: The device.
        placed: Its modules with their places.
    """
    return tuple(_configured(device, each) for each in placed)


def with_slots(device: DeviceDescription, esi: EsiDevice) -> DeviceDescription:
    """Return the description with the slots of an ESI and its default modules.

    Args:
        device: Description with the PDOs and the settings of the ESI, without modules.
        esi: Its ESI; the description is returned unchanged if it is not modular.
    """
    slots = esi.slots
    if slots is None:
        return device
    commands = () if esi.mailbox is None else esi.mailbox.init_commands
    modular = ModularDevice(
        slots=tuple(place.name for place in slot_places(slots)),
        known=tuple((module.ident, module.type or module.name) for module in esi.modules),
        output_pdos=device.output_pdos,
        input_pdos=device.input_pdos,
        init_commands=device.init_commands,
        documented=device.documented,
        replaceable_pdos=frozenset(pdo.index for pdo in esi.pdos if pdo.overwritten_by_module),
        replaceable_commands=frozenset(
            (each.index, each.subindex) for each in commands if each.overwritten_by_module
        ),
        download_idents=slots.download_module_idents,
        identify_by=slots.identify_by,
        source=str(esi.source),
    )
    return _with_placements(replace(device, modular=modular), esi, default_placements(esi))


def with_reported_modules(device: DeviceDescription, esi: EsiDevice) -> DeviceDescription:
    """Return the description with the modules that the device reports, if it reports any.

    Those that it detected (0xF050) count, then those that are configured (0xF030). Notes name the
    modules that the ESI does not describe.

    Args:
        device: Description with the lists of the device.
        esi: Its ESI.
    """
    modular = device.modular
    if modular is None:
        return device
    lists = {DETECTED_IDENTS: modular.detected, CONFIGURED_IDENTS: modular.configured}
    for index, idents in lists.items():
        if idents is not None and any(idents):
            return _with_idents(device, esi, idents, f"reported in 0x{index:04X}")
    return device


def _with_idents(
    device: DeviceDescription, esi: EsiDevice, idents: Sequence[int], source: str
) -> DeviceDescription:
    places = tuple(slot_places(esi.slots)) if esi.slots is not None else ()
    modules = {module.ident: module for module in esi.modules}
    placed, others, notes = [], [], []
    for number, ident in enumerate(idents):
        place = places[number] if number < len(places) else None
        module = modules.get(ident)
        if place is not None and module is not None and accepts(place.slot, module):
            placed.append(Placement(module, place))
        elif ident:
            reason = "does not describe" if module is None else "does not accept there"
            where = place or f"slot {number}"
            notes.append(f"{where} has a module 0x{ident:08X}, which its ESI {reason}")
            # Without PDOs, but with its ident, so that the plan does not remove it from 0xF030
            name = "unknown module" if module is None else module.type or module.name
            others.append(ConfiguredModule(number, place.name if place else "", ident, name))
    device = replace(device, notes=(*device.notes, *notes))
    return _with_placements(device, esi, tuple(placed), source, others)


def _with_placements(
    device: DeviceDescription,
    esi: EsiDevice,
    placed: Sequence[Placement],
    source: str = DEFAULTS,
    others: Sequence[ConfiguredModule] = (),
) -> DeviceDescription:
    """Return the description with modules, or with a note if they contradict each other.

    `others` are modules that the ESI does not describe in their slots.
    """
    try:
        check_indices(esi, placed)
    except ConfigurationError as error:
        note = f"its modules ({source}) are not used: {error.message}"
        return replace(device, notes=(*device.notes, note))
    modules = sorted((*configured(esi, placed), *others), key=lambda each: each.slot)
    fitted = with_modules(device, modules, source)
    return with_mapping_of(fitted, device) if device.mapping_source in READ_SOURCES else fitted


def _configured(device: EsiDevice, placed: Placement) -> ConfiguredModule:
    module, place = placed_module(placed), placed.place
    own = replace(device, dictionary=module.dictionary)
    return ConfiguredModule(
        slot=place.number,
        slot_name=place.name,
        ident=module.ident,
        name=module.type or module.name,
        output_pdos=_pdos(own, module.pdos, Direction.OUTPUT),
        input_pdos=_pdos(own, module.pdos, Direction.INPUT),
        init_commands=tuple(init_command(each) for each in module.init_commands),
        documented=documented_objects(module.dictionary),
        pdo_offset=place.pdo_offset,
        index_offset=place.index_offset,
        pdo_group=module.pdo_group,
        source=str(module.source),
    )


def _pdos(device: EsiDevice, pdos: Sequence[EsiPdo], direction: Direction) -> tuple[Pdo, ...]:
    """Return PDOs of a module. A mandatory one without `Sm` gets the first fitting SyncManager."""
    fitting = [each.index for each in device.sync_managers if each.use is direction.use]
    found = []
    for pdo in pdos:
        if pdo.direction is not direction:
            continue
        channel = pdo.sync_manager
        if channel is None and pdo.mandatory and fitting:
            channel = fitting[0]
        found.append(model_pdo(device, pdo, channel))
    return tuple(found)

"""Descriptions of modular devices with other modules in their slots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from catenary.model.describe import assignments
from catenary.model.device import DeviceDescription, Direction
from catenary.model.esi_settings import InitCommand
from catenary.model.module import ConfiguredModule, ModularDevice


def with_modules(
    device: DeviceDescription, modules: Sequence[ConfiguredModule], source: str
) -> DeviceDescription:
    """Return the description of a modular device with other modules in its slots.

    The PDOs of the modules follow those of the device, by group and slot (ETG.5001). The assignment
    is the default one.

    Args:
        device: A modular device.
        modules: The modules, in the order of their slots.
        source: Reason for these modules.
    """
    modular = device.modular
    if modular is None:
        return device
    by_group = sorted(modules, key=lambda each: each.pdo_group)
    for direction in Direction:
        own = modular.own_pdos(direction)
        added = tuple(pdo for each in by_group for pdo in each.pdos(direction))
        replaced = modular.replaceable_pdos & {pdo.index for pdo in added}
        pdos = (*(pdo for pdo in own if pdo.index not in replaced), *added)
        device = device.with_process_data(direction, assignments(pdos), pdos)
    axes = tuple(sorted({axis for each in modules for axis in each.axes}))
    return replace(
        device,
        init_commands=_commands(modular, modules),
        documented=(*modular.documented, *(o for each in modules for o in each.documented)),
        slots=axes or device.slots,
        modular=replace(modular, modules=tuple(modules), modules_source=source),
        mapping_source=f"ESI {modular.source}",
    )


def with_mapping_of(fitted: DeviceDescription, device: DeviceDescription) -> DeviceDescription:
    """Return a description with modules, and with the mapping that the device reports.

    Args:
        fitted: The description with modules.
        device: The description with the present mapping.
    """
    for direction in Direction:
        known = {pdo.index for pdo in device.pdos(direction)}
        added = tuple(
            replace(pdo, sync_manager=None)
            for pdo in fitted.pdos(direction)
            if pdo.index not in known
        )
        fitted = fitted.with_process_data(
            direction, device.assignments(direction), device.pdos(direction) + added
        )
    return replace(fitted, mapping_source=device.mapping_source)


def _commands(
    modular: ModularDevice, modules: Sequence[ConfiguredModule]
) -> tuple[InitCommand, ...]:
    added = [command for each in modules for command in each.init_commands]
    replaced = modular.replaceable_commands & {(each.index, each.subindex) for each in added}
    own = (e for e in modular.init_commands if (e.index, e.subindex) not in replaced)
    return (*own, *added)

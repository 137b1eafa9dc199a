"""Modules of modular devices (ETG.5001) in a plan: the requested ones, and the idents to write.

Order of trust: the modules that the application requests, those that the device detected (0xF050),
those that are configured in it (0xF030), the default modules of the ESI.

0xF030 is written first if the ESI requires it (`DownloadModuleIdentList`), or if it differs from
modules that the application requests or the device detected. Devices compare it with 0xF050 and
refuse SAFE-OP with AL status 0x0070 if they differ: SOEM, which does not write it, fails until
TwinCAT has written it (SOEM#884). The sample of Beckhoff's slave stack (SSC,
`Module_UpdateObjectDictionary`) adds the objects of the modules only when 0xF030 is written.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace

from catenary.errors import ConfigurationError
from catenary.model.device import DeviceDescription, Direction, mapped_pdos
from catenary.model.module import (
    CONFIGURED_IDENTS,
    DEFAULTS,
    REQUESTED,
    ConfiguredModule,
    ModularDevice,
    same_idents,
    slot_idents,
)
from catenary.model.module_mapping import with_modules
from catenary.plan.download import Download

IDENTS_MAX = 255


@dataclass(frozen=True, slots=True)
class ModulePlan:
    """Modules of one device, and the idents to write to 0xF030."""

    device: ModularDevice  # slots, names, and lists of the device
    modules: tuple[ConfiguredModule, ...]
    source: str  # reason for these modules
    downloads: tuple[Download, ...] = ()  # of 0xF030; empty: unchanged

    @property
    def idents(self) -> tuple[int, ...]:
        """Expected idents by slot; 0 for an empty slot."""
        return slot_idents(self.modules)


def with_requested_modules(
    device: DeviceDescription, modules: Sequence[ConfiguredModule] | None
) -> DeviceDescription:
    """Return the description with the modules that the application requests.

    A device keeps the mapping that it reports if these modules are configured in it, and their PDOs
    are assigned. Otherwise, the default assignment of the modules counts, because writing 0xF030
    can change the mapping.

    Args:
        device: Description of the device.
        modules: Requested modules; None: as described.

    Raises:
        ConfigurationError: The device has no slots.
    """
    modular = device.modular
    if modules is None:
        if modular is None or not _is_rewritten(device, modular, modular.modules_source):
            return device
        return with_modules(device, modular.modules, modular.modules_source)
    if modular is None:
        raise ConfigurationError(
            f"{device} has no slots for modules: no ESI of a modular device was used for it",
            hint="scan with its ESI file, main.scan(esi=...), or omit modules=",
        )
    same = same_idents(modular.idents, slot_idents(modules))
    if same and not _is_rewritten(device, modular, REQUESTED) and _carries(device, modules):
        return device
    return with_modules(device, modules, REQUESTED)


def _carries(device: DeviceDescription, modules: Sequence[ConfiguredModule]) -> bool:
    """Return True if all PDOs that modules assign by default are assigned."""
    assigned = {pdo.index for d in Direction for pdo in mapped_pdos(device.assignments(d))}
    defaults = (p for m in modules for d in Direction for p in m.pdos(d))
    return all(pdo.index in assigned for pdo in defaults if pdo.sync_manager is not None)


def _is_rewritten(device: DeviceDescription, modular: ModularDevice, source: str) -> bool:
    """Return True if the plan writes 0xF030 because its idents differ from the modules in use."""
    before = modular.configured
    return (
        device.coe
        and source != DEFAULTS
        and before is not None
        and not same_idents(before, modular.idents)
    )


def make_module_plan(
    device: DeviceDescription, modules: Sequence[ConfiguredModule] | None
) -> ModulePlan | None:
    """Return the modules of a device, and the idents to write; None if it is not modular.

    Args:
        device: Description with the modules in use.
        modules: Modules that the application requested; None: those of the description.
    """
    modular = device.modular
    if modular is None:
        return None
    chosen = modular.modules if modules is None else tuple(modules)
    source = modular.modules_source if modules is None else REQUESTED
    return ModulePlan(modular, chosen, source, _downloads(device, modular, chosen, source))


def _downloads(
    device: DeviceDescription,
    modular: ModularDevice,
    modules: tuple[ConfiguredModule, ...],
    source: str,
) -> tuple[Download, ...]:
    """Return the downloads of 0xF030. Subindex 0 is optional: it can be read-only."""
    before = modular.configured
    chosen = replace(modular, modules=modules)
    if not (device.coe and modular.download_idents) and not _is_rewritten(device, chosen, source):
        return ()
    idents = slot_idents(modules)
    count = min(max(len(idents), len(before or ())), IDENTS_MAX)
    padded = (*idents, *[0] * (count - len(idents)))
    ranks = enumerate(padded, start=1)
    return (
        Download(CONFIGURED_IDENTS, 0, b"\x00", optional=True),
        *(
            Download(CONFIGURED_IDENTS, k, struct.pack("<I", i), text=modular.module_name(i))
            for k, i in ranks
        ),
        Download(CONFIGURED_IDENTS, 0, bytes([count]), optional=True),
    )


def ident_difference(plan: ModulePlan, detected: Sequence[int]) -> str:
    """Return the slots whose detected module is not the expected one; empty if there are none.

    A device that cannot detect its modules reports zeros; these are not compared.

    Args:
        plan: Modules of the device.
        detected: Idents in 0xF050.
    """
    if not any(detected):
        return ""
    expected = plan.idents
    names = plan.device
    count = max(len(expected), len(detected))
    both = zip(_padded(expected, count), _padded(detected, count), strict=True)
    return "; ".join(
        f"{names.slot_name(slot)}: expected {names.module_name(one)}, "
        f"found {names.module_name(other)}"
        for slot, (one, other) in enumerate(both)
        if one != other
    )


def module_lines(plan: ModulePlan) -> list[str]:
    """Return the modules by slot as text, with their PDOs, objects and sources."""
    lines = [f"modules {plan.source}" + ": none" * (not plan.modules)]
    for each in plan.modules:
        pdos = [f"0x{pdo.index:04X}" for pdo in (*each.output_pdos, *each.input_pdos)]
        objects = f", objects + 0x{each.index_offset:X}" * bool(each.index_offset)
        lines.append(
            f"    {plan.device.slot_name(each.slot)}: {each}, PDOs {', '.join(pdos) or 'none'}"
            f"{objects}  {each.source}".rstrip()
        )
    return lines


def ident_lines(plan: ModulePlan) -> list[str]:
    """Return the idents that are written, with their old values, as text."""
    if not plan.downloads:
        return []
    configured = plan.device.configured
    old = "(not read)" if configured is None else _idents_text(configured)
    return [f"0x{CONFIGURED_IDENTS:04X}  {old} → {_idents_text(plan.idents)}"]


def _padded(idents: Sequence[int], count: int) -> tuple[int, ...]:
    return (*idents, *[0] * (count - len(idents)))


def _idents_text(idents: Sequence[int]) -> str:
    return ", ".join(f"0x{ident:08X}" for ident in idents) or "none"

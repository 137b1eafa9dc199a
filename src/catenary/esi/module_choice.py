"""Choice of modules for the slots of a modular device, by name, type or ident."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from typing import TypeAlias

from catenary.errors import ConfigurationError
from catenary.esi.device import EsiDevice, EsiModule, EsiPdo, EsiSlots
from catenary.esi.placement import (
    Placement,
    SlotPlace,
    accepted_by,
    accepts,
    fits,
    placed_module,
    slot_places,
)

ModuleName: TypeAlias = str | int  # name, type or ident
SHOWN = 12  # modules in an error


def choose_modules(device: EsiDevice, choice: Sequence[ModuleName | None]) -> tuple[Placement, ...]:
    """Return the chosen modules with their places.

    Args:
        device: Modular device with its modules.
        choice: Module of each slot, in order: name, type or ident; None, "" or 0 for an empty slot.
            Slots after the last element stay empty.

    Raises:
        ConfigurationError: The device is not modular, a module is unknown or not accepted by its
            slot, a required slot is empty, or two modules have the same PDO.
        TypeError: `choice` is not a list of names and idents.
    """
    if isinstance(choice, str) or not isinstance(choice, Sequence):
        raise TypeError(
            f'modules={choice!r} is not a list; give one module per slot: ["8 DI", None]'
        )
    if device.slots is None:
        raise ConfigurationError(
            f"{device} has no slots for modules",
            hint="omit modules=, or use the ESI file of the modular device",
        )
    places = tuple(slot_places(device.slots))
    if len(choice) > len(places):
        raise ConfigurationError(
            f"{device}: modules= has {len(choice)} elements, but the device has "
            f"{len(places)} slots",
            hint=_slots_text(device, device.slots),
        )
    placed = []
    for place, wanted in zip(places, (*choice, *[None] * len(places)), strict=False):
        if wanted:
            placed.append(Placement(_module(device, place, wanted), place))
        elif place.required:
            raise ConfigurationError(
                f"{device}: {place} must have a module, but modules= leaves it empty",
                hint=_accepted_text(device, place),
            )
    check_indices(device, placed)
    return tuple(placed)


def check_indices(device: EsiDevice, placed: Sequence[Placement]) -> None:
    """Check that the indices of modules are valid, and that each PDO exists once.

    Args:
        device: The device.
        placed: The modules with their places.

    Raises:
        ConfigurationError: An index is above 0xFFFF, or two PDOs have the same index.
    """
    kept = (pdo for pdo in device.pdos if not pdo.overwritten_by_module)
    known: dict[int, tuple[str, EsiPdo]] = {pdo.index: ("the device itself", pdo) for pdo in kept}
    for each in placed:
        if not fits(each):
            raise ConfigurationError(
                f"{device}: {each.module.type!r} in {each.place} has indices above 0xFFFF",
                hint=f"use another slot, or correct the increments in {device.source.file}",
            )
        owner = f"{each.module.type!r} in {each.place}"
        for pdo in placed_module(each).pdos:
            if pdo.index in known:
                other, first = known[pdo.index]
                raise ConfigurationError(
                    f"{device}: PDO 0x{pdo.index:04X} belongs to {other} ({first.source}) and to "
                    f"{owner} ({pdo.source})",
                    hint="these modules cannot be used together; the ESI file may lack "
                    "DependOnSlot or SlotPdoIncrement",
                )
            known[pdo.index] = owner, pdo


def _module(device: EsiDevice, place: SlotPlace, wanted: ModuleName) -> EsiModule:
    """Return the module that a slot accepts under a name or ident."""
    accepted = accepted_by(device, place.slot)
    found = _matching(accepted, wanted)
    if len({each.ident for each in found}) == 1:
        return found[0]
    if found:
        idents = ", ".join(f"0x{each.ident:08X} ({each.source})" for each in found)
        raise ConfigurationError(
            f"{device}: {place} accepts several modules with the name {wanted!r}: {idents}",
            hint="give the ident",
        )
    shown = wanted if isinstance(wanted, str) else f"0x{wanted:08X}"
    others = _matching(device.modules, wanted)
    if others:
        raise ConfigurationError(
            f"{device}: {place} does not accept {shown!r}, ident 0x{others[0].ident:08X} "
            f"({others[0].source})",
            hint=_accepted_text(device, place),
        )
    names = [text for each in accepted for text in (each.type, each.name)]
    near = get_close_matches(str(wanted), names, n=1)
    guess = f"did you mean {near[0]!r}? " if near else ""
    raise ConfigurationError(
        f"{device}: unknown module {shown!r} for {place}",
        hint=guess + _accepted_text(device, place),
    )


def _matching(modules: Sequence[EsiModule], wanted: ModuleName) -> tuple[EsiModule, ...]:
    """Return the modules with an ident, type or name; types count more than names."""
    ident = wanted if isinstance(wanted, int) else _number(wanted)
    if ident is not None:
        found = tuple(each for each in modules if each.ident == ident)
        if found or isinstance(wanted, int):
            return found
    text = _normal(str(wanted))
    by_type = tuple(each for each in modules if _normal(each.type) == text)
    return by_type or tuple(each for each in modules if _normal(each.name) == text)


def _number(text: str) -> int | None:
    try:
        return int(text.replace("#x", "0x"), 0)
    except ValueError:
        return None


def _normal(text: str) -> str:
    return " ".join(text.split()).casefold()


def _accepted_text(device: EsiDevice, place: SlotPlace) -> str:
    """Return the modules that a slot accepts, as a hint."""
    accepted = accepted_by(device, place.slot)
    if not accepted:
        return (
            f"no module for {place} was found; add the file of its modules: catenary esi add FILE"
        )
    return f"{place} accepts {modules_text(accepted)}"


def modules_text(modules: Sequence[EsiModule]) -> str:
    """Return the names and idents of modules, at most 12."""
    shown = [f"{each.type!r} (0x{each.ident:08X})" for each in modules[:SHOWN]]
    more = [f"{len(modules) - SHOWN} more"] if len(modules) > SHOWN else []
    return ", ".join(shown + more)


def _slots_text(device: EsiDevice, slots: EsiSlots) -> str:
    shown = [
        f"{place} accepts {sum(accepts(place.slot, each) for each in device.modules)} modules"
        for place in list(slot_places(slots))[:SHOWN]
    ]
    return "its slots: " + "; ".join(shown)

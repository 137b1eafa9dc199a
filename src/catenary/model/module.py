"""Modular devices (ETG.5001, MDP): their slots, and the modules in them.

An ESI file describes both. A device with CoE reports the idents of the modules that it detected in
0xF050, and has those that are configured in 0xF030. Subindex k + 1 belongs to slot k.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from catenary.model.esi_settings import InitCommand
from catenary.model.process_data import Direction, ObjectInformation, Pdo

CONFIGURED_IDENTS, DETECTED_IDENTS = 0xF030, 0xF050
BY_IDENT = ("", "ModuleIdent")  # values of `IdentifyModuleBy` for a comparison of idents
DEFAULTS, REQUESTED = "default modules of the ESI", "as requested"
STATUSWORD, AXIS_STRIDE, AXES_MAX = 0x6041, 0x800, 16


@dataclass(frozen=True, slots=True)
class ConfiguredModule:
    """Module in a slot. Its indices include the increments of the slot."""

    slot: int  # from 0, counted over all instances of all slots
    slot_name: str
    ident: int
    name: str  # its type in the ESI; without one, its name
    output_pdos: tuple[Pdo, ...] = ()
    input_pdos: tuple[Pdo, ...] = ()
    init_commands: tuple[InitCommand, ...] = ()
    documented: tuple[ObjectInformation, ...] = ()  # its part of the dictionary
    pdo_offset: int = 0  # added to PDO indices that depend on the slot
    index_offset: int = 0  # added to object indices that depend on the slot
    pdo_group: int = 0  # PDOs are assigned by group, then by slot
    source: str = ""  # file and line

    def pdos(self, direction: Direction) -> tuple[Pdo, ...]:
        """Return the PDOs of one direction."""
        return self.output_pdos if direction is Direction.OUTPUT else self.input_pdos

    @property
    def axes(self) -> tuple[int, ...]:
        """Numbers k of the CiA 402 axes, whose statusword is 0x6041 + 0x800·k."""
        mapped = {entry.index for pdo in self.input_pdos for entry in pdo.entries}
        indices = mapped | {each.index for each in self.documented}
        return tuple(k for k in range(AXES_MAX) if STATUSWORD + AXIS_STRIDE * k in indices)

    def __str__(self) -> str:
        return f"{self.name} (0x{self.ident:08X})"


@dataclass(frozen=True, slots=True)
class ModularDevice:
    """Slots of a modular device, its own part of the description, and the modules in use."""

    slots: tuple[str, ...]  # names, from slot 0
    known: tuple[tuple[int, str], ...]  # names of the modules in the ESI, by ident
    output_pdos: tuple[Pdo, ...] = ()  # of the device itself, without modules
    input_pdos: tuple[Pdo, ...] = ()
    init_commands: tuple[InitCommand, ...] = ()
    documented: tuple[ObjectInformation, ...] = ()
    replaceable_pdos: frozenset[int] = frozenset()  # `OverwrittenByModule`
    replaceable_commands: frozenset[tuple[int, int]] = frozenset()
    download_idents: bool = False  # the ESI requires that 0xF030 is written
    identify_by: str = ""  # `IdentifyModuleBy`
    source: str = ""  # file and line of its ESI
    modules: tuple[ConfiguredModule, ...] = ()
    modules_source: str = ""  # reason for these modules
    detected: tuple[int, ...] | None = None  # 0xF050; None if it cannot be read
    configured: tuple[int, ...] | None = None  # 0xF030; None if it cannot be read

    @property
    def idents(self) -> tuple[int, ...]:
        """Idents of the modules in use, by slot; 0 for an empty slot."""
        return slot_idents(self.modules)

    def own_pdos(self, direction: Direction) -> tuple[Pdo, ...]:
        """Return the PDOs of the device itself, without its modules."""
        return self.output_pdos if direction is Direction.OUTPUT else self.input_pdos

    def module_name(self, ident: int) -> str:
        """Return the name of a module with its ident; "empty" for 0."""
        if not ident:
            return "empty"
        known = dict(self.known).get(ident, "a module that its ESI does not describe")
        return f"{known} (0x{ident:08X})"

    def slot_name(self, slot: int) -> str:
        """Return the number and the name of a slot."""
        name = self.slots[slot] if slot < len(self.slots) else ""
        return f"slot {slot} ({name})" if name else f"slot {slot}"


def slot_idents(modules: Iterable[ConfiguredModule]) -> tuple[int, ...]:
    """Return the idents of modules by slot, up to the last module; 0 for an empty slot."""
    by_slot = {each.slot: each.ident for each in modules}
    return tuple(by_slot.get(slot, 0) for slot in range(max(by_slot, default=-1) + 1))


def same_idents(one: Sequence[int], other: Sequence[int]) -> bool:
    """Return True if two lists of idents differ at most in empty slots at their ends."""
    return _trimmed(one) == _trimmed(other)


def _trimmed(idents: Sequence[int]) -> tuple[int, ...]:
    end = max((k + 1 for k, ident in enumerate(idents) if ident), default=0)
    return tuple(idents[:end])

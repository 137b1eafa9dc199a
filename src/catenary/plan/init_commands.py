"""Objects that an ESI or ENI requires to be written at state transitions (`CoE/InitCmd`).

Commands of the transitions IP and PS are written in PRE-OP, in this order, before the start-up
objects of the application. The mailbox is not available in INIT, so IP is the first step in
PRE-OP. Commands of SO are written in SAFE-OP. Commands of downward transitions are not written.
TwinCAT and CODESYS also write these commands by default.

A command is omitted if the application or Catenary sets its object. These values take precedence.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

from catenary.model.device import DeviceDescription, Entry
from catenary.model.esi_settings import InitCommand
from catenary.plan.download import Download
from catenary.plan.start_up_object import MAPPING_OBJECTS, StartUp

PRE_OP_STEPS, SAFE_OP_STEPS = ("IP", "PS"), ("SO",)
BY_PLAN = "the plan writes the mapping"  # reason to omit a command


class Commands(NamedTuple):
    """Commands of an ESI, by the state in which they are written."""

    in_pre_op: tuple[Download, ...] = ()
    in_safe_op: tuple[Download, ...] = ()
    omitted: tuple[str, ...] = ()  # commands that are not written, and the reason
    origin: str = "ESI"  # or "ENI"

    @property
    def written(self) -> tuple[Download, ...]:
        """Commands of both states."""
        return self.in_pre_op + self.in_safe_op


NO_COMMANDS = Commands()


def choose_commands(
    device: DeviceDescription,
    objects: Sequence[StartUp],
    own: Collection[tuple[int, int]],
    outputs: Sequence[Entry],
) -> Commands:
    """Return the commands of a device's ESI that a plan writes.

    Args:
        device: Device with its commands.
        objects: Start-up objects of the application. They replace commands that are not fixed.
        own: Index and subindex of the objects that Catenary writes.
        outputs: Mapped outputs, which change in every cycle.
    """
    if not device.init_commands or not device.coe:
        return NO_COMMANDS
    origin = device.commands_origin
    given = {(each.index, each.subindex) for each in objects}
    mapped = {(entry.index, entry.subindex) for entry in outputs}
    reasons = {each: _reason(each, given, own, mapped) for each in device.init_commands}
    written = [each for each in device.init_commands if not reasons[each]]
    known = {*PRE_OP_STEPS, *SAFE_OP_STEPS}
    omitted = [
        f"{_place(each)}: {reason} ({each.source})"
        for each, reason in reasons.items()
        if reason and known.intersection(each.transitions)
    ]
    in_pre_op = tuple(_downloads(written, PRE_OP_STEPS, origin))
    # In SAFE-OP, a fixed command would follow the object of the application, and undo it.
    late = [each for each in written if not _is_given(each, given)]
    omitted += [
        f"{_place(each)}: in SAFE-OP, your start-up object counts more ({each.source})"
        for each in written
        if each not in late and {*SAFE_OP_STEPS}.intersection(each.transitions)
    ]
    in_safe_op = tuple(_downloads(late, SAFE_OP_STEPS, origin))
    return Commands(in_pre_op, in_safe_op, tuple(omitted), origin)


def _reason(
    command: InitCommand,
    given: Collection[tuple[int, int]],
    own: Collection[tuple[int, int]],
    mapped: Collection[tuple[int, int]],
) -> str:
    """Return the reason why a command is not written; empty if it is written."""
    place = (command.index, command.subindex)
    if any(command.index in objects for objects in MAPPING_OBJECTS):
        return BY_PLAN
    if _is_given(command, given) and not command.fixed:
        return "your start-up object replaces it"
    if place in own:
        return "Catenary writes this object"
    if place in mapped:
        data = command.data.hex(" ")
        return f"the process data writes this output in each cycle; set it to {data} there"
    return ""


def _is_given(command: InitCommand, given: Collection[tuple[int, int]]) -> bool:
    """Return True if the application writes the object, or a part of it."""
    if command.complete_access:
        return any(index == command.index for index, _ in given)
    return (command.index, command.subindex) in given


def _downloads(
    commands: Sequence[InitCommand], steps: Sequence[str], origin: str
) -> Iterator[Download]:
    """Yield the commands of the steps. One of both IP and PS is written once, at IP.

    The same object may occur with the same value again, such as a key that unlocks parameters.
    """
    for number, step in enumerate(steps):
        for each in commands:
            if step in each.transitions and not set(steps[:number]).intersection(each.transitions):
                yield Download(
                    each.index,
                    each.subindex,
                    each.data,
                    complete_access=each.complete_access,
                    source=f"{each.source} {each.comment}".strip(),
                    origin=origin,
                )


def _place(command: InitCommand) -> str:
    return f"0x{command.index:04X}:{command.subindex:02X}"

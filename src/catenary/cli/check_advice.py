"""Next steps after `catenary check --against line/`."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from catenary.bus.clone_device import IN_INIT
from catenary.errors import DecodeError
from catenary.line.change import Change, ChangedEntry, Comparison, Part, Severity
from catenary.line.compare import IN_REGISTER
from catenary.types import by_name

SHOWN = 3  # commands of one kind


def next_steps(found: Comparison, arguments: argparse.Namespace) -> Iterator[str]:
    """Yield what to do about the changes, without repetition.

    Args:
        found: The comparison.
        arguments: The command line.
    """
    target = _target(arguments)
    relevant = [
        each for each in found.changes if each.severity in (Severity.EFFECT, Severity.FAULT)
    ]
    parts = {each.part for each in relevant}
    if any(each.part is Part.DEVICE and each.device.new is None for each in relevant):
        yield "check cable and power of the missing devices, from the named port on"
    if Part.TOPOLOGY in parts:
        yield "put the cables back, or clone again if the wiring was changed on purpose"
    yield from _restored(relevant, target)
    if parts & {Part.ASSIGNMENT, Part.MAPPING}:
        yield "a program writes assignment and mapping at start-up: start it, then compare again"
    if Part.ERRORS in parts:
        yield f"find the cable or device at fault: catenary diag {target} --seconds 10"
    if Part.STATE in parts:
        yield f"read the reason of the error: catenary state {target}"
    in_init = any(each.expected and each.reason == IN_INIT for each in found.uncompared)
    if in_init and not Path(arguments.file).is_dir():
        yield "to compare the objects of devices in INIT, add --pre-op"
    if parts - {Part.ERRORS, Part.STATE}:
        fresh = "" if found.unread else " --fresh"  # without it, complete devices are kept
        yield (
            "if everything is as intended, replace the clone: "
            f"catenary clone {target} -o {arguments.against}{fresh} --pre-op"
        )


def _target(arguments: argparse.Namespace) -> str:
    if Path(arguments.file).is_dir():
        return "TARGET"
    return str(arguments.target or arguments.file)


def _restored(changes: Sequence[Change], target: str) -> Iterator[str]:
    """Yield the commands that write earlier values."""
    commands = [text for each in changes if (text := _command(each, target))]
    for text in commands[:SHOWN]:
        yield f"write the earlier value: {text}"
    if len(commands) > SHOWN:
        yield f"write {len(commands) - SHOWN} more values in the same way"


def _command(change: Change, target: str) -> str:
    """Return the command that restores a value; empty if none does."""
    position = change.device.new
    if position is None:
        return ""
    if change.part is Part.ALIAS:
        if change.what == IN_REGISTER:
            return ""
        return f"catenary alias {target} {position} {change.old}"
    return _sdo_write(change.entry, f"{target} {position}") if change.entry is not None else ""


def _sdo_write(entry: ChangedEntry, device: str) -> str:
    """Return the command that writes a number; empty for other values."""
    if entry.old is None or not entry.writable:
        return ""
    try:
        value = by_name(entry.type).decode(entry.old)
    except (ValueError, DecodeError):  # another type, or bytes that do not fit it
        return ""
    if not isinstance(value, int | float):
        return ""
    place = f"0x{entry.index:04X}:{entry.subindex}"
    return f"catenary sdo write {device} {place} {value} --type {entry.type}"

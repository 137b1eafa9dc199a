"""`catenary check TARGET --against machine.toml`: differences, and what needs these devices."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli import check_machine
from catenary.cli.failure import UsageError
from catenary.cli.parsers import note_other_masters

if TYPE_CHECKING:
    from catenary.machine import Comparison
    from catenary.machine.comparison import FoundDevice
    from catenary.machine.file import MachineFile

    Comparisons = Sequence[Comparison[FoundDevice]]


def run(arguments: argparse.Namespace) -> int:
    """Compare a segment or a clone with a machine file, and print the result."""
    from catenary.machine import read_machine
    from catenary.machine.roles import roles_by_device

    expected = read_machine(arguments.against)
    found = _compared(arguments, expected)
    roles = roles_by_device(expected)
    print(as_json(found, roles) if arguments.json else as_text(found, roles, arguments.against))
    return check_machine.status_of(found)


def _compared(arguments: argparse.Namespace, expected: MachineFile) -> Comparisons:
    from catenary.line import read_line
    from catenary.machine import compare
    from catenary.machine.cloned import compare_clone
    from catenary.target import MainDevice

    devices = expected.tables.device
    if Path(arguments.file).is_dir():
        if arguments.target is not None:
            raise UsageError("a clone has no target", hint="name only the folder of the clone")
        return compare_clone(devices, read_line(arguments.file), arguments.file)
    source, _ = check_machine.source_and_machine(arguments.file, arguments.target)
    with MainDevice(source, force=True) as main:
        note_other_masters(main)
        return compare(devices, main.passive_scan())


def as_text(found: Comparisons, roles: Mapping[str, Sequence[str]], file: str) -> str:
    """Return the table of `check`, and a line per difference with the roles that it affects."""
    from catenary.machine import HARMLESS

    lines = [check_machine.as_table(found)]
    different = [each for each in found if each.verdict not in HARMLESS]
    for each in different:
        if needed := affected(each, roles):
            lines.append(f"{each.name} is {each.verdict}: it is needed by {', '.join(needed)}")
    same = f"{len(found)} {'device' if len(found) == 1 else 'devices'} as in {file}"
    lines.append(f"{len(different)} of {len(found)} devices differ" if different else same)
    return "\n".join(lines)


def as_json(found: Comparisons, roles: Mapping[str, Sequence[str]]) -> str:
    """Return the comparisons as JSON, with the roles that need each device."""
    values = check_machine.as_values(found)
    for each, value in zip(found, values, strict=True):
        value["roles"] = affected(each, roles)
    return json.dumps(values, indent=2)


def affected(found: Comparison[FoundDevice], roles: Mapping[str, Sequence[str]]) -> Sequence[str]:
    """Return the roles that need a device; none for a device that the file does not have.

    Args:
        found: Comparison of the device.
        roles: Roles by the name of the device.
    """
    return [] if found.expected is None else list(roles.get(found.name, ()))

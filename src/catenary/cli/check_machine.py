"""`catenary check machine.toml`: compare the devices of a machine file with the segment."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.parsers import note_other_masters

if TYPE_CHECKING:
    from catenary.link import LinkSource
    from catenary.machine import Comparison
    from catenary.machine.comparison import FoundDevice
    from catenary.machine.file import MachineFile

SAME, DIFFERENT = 0, 1


def run(arguments: argparse.Namespace) -> int:
    """Compare the segment with the machine file, and print the result."""
    found = compare_with_segment(arguments.file, arguments.target)
    print(as_json(found) if arguments.json else as_table(found))
    return status_of(found)


def status_of(found: Sequence[Comparison[FoundDevice]]) -> int:
    """Return the exit status of a comparison with a machine file."""
    from catenary.machine import HARMLESS

    return SAME if all(each.verdict in HARMLESS for each in found) else DIFFERENT


def source_and_machine(file: str, target: str | None) -> tuple[LinkSource, MachineFile | None]:
    """Return the source of the link, and the machine file if the first argument is one.

    Args:
        file: First argument: a machine file or a target.
        target: Second argument: target instead of the one in the file.
    """
    from catenary.machine import read_machine
    from catenary.target import source_of

    if target is None and not Path(file).is_file():
        return source_of(file), None
    expected = read_machine(file)
    return (expected.source() if target is None else source_of(target)), expected


def compare_with_segment(file: str, target: str | None) -> Sequence[Comparison[FoundDevice]]:
    """Compare a machine file with its segment, or with the segment of another target.

    Args:
        file: Path of the machine file.
        target: Target instead of the one in the file; None for that of the file.
    """
    from catenary.machine import compare, read_machine
    from catenary.target import MainDevice, source_of

    expected = read_machine(file)
    source = expected.source() if target is None else source_of(target)
    with MainDevice(source, force=True) as main:
        note_other_masters(main)
        return compare(expected.tables.device, main.passive_scan())


def as_table(found: Sequence[Comparison[FoundDevice]]) -> str:
    """Return the comparisons as a table with one line per device."""
    from catenary.cli.tables import table
    from catenary.machine import address

    rows = [("verdict", "name", "address", "pos", "")]
    for each in found:
        where = "" if each.expected is None else address(each.expected)
        position = "" if each.found is None else str(each.found.position)
        text = f"{each.fault} ({each.cause})" if each.cause else each.fault
        rows.append((each.verdict, each.name, where, position, text))
    return table(rows)


def as_json(found: Sequence[Comparison[FoundDevice]]) -> str:
    """Return the comparisons as JSON."""
    return json.dumps(as_values(found), indent=2)


def as_values(found: Sequence[Comparison[FoundDevice]]) -> list[dict[str, object]]:
    """Return the comparisons as values for JSON."""
    from catenary.machine import address, expected_identity

    return [
        {
            "verdict": each.verdict,
            "name": each.name,
            "address": None if each.expected is None else address(each.expected),
            "position": None if each.found is None else each.found.position,
            "expected": None if each.expected is None else expected_identity(each.expected),
            "found": None if each.found is None else str(each.found.identity),
            "fault": each.fault,
            "cause": each.cause,
        }
        for each in found
    ]

"""`catenary check machine.toml`: compare the devices of a machine file with the segment."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

from catenary.cli.parsers import Commands, add_command, add_json, note_other_masters

if TYPE_CHECKING:
    from catenary.machine import Comparison

SAME, DIFFERENT, UNREADABLE = 0, 1, 2


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "check",
        help="compare a machine file with the segment",
        description="Compares the addresses and identities of the devices with a machine file, "
        "and changes no device. Exit status: 0 if they match, 1 if they differ, 2 if the file "
        "or the segment cannot be read.",
        example="catenary check machine.toml\ncatenary check machine.toml eth1 --json",
    )
    parser.add_argument("file", metavar="FILE", help="the machine file")
    parser.add_argument(
        "target",
        metavar="TARGET",
        nargs="?",
        help="target instead of the one in the file: eth0 ...",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.failure import report
    from catenary.errors import CatenaryError

    try:
        found = compare_with_segment(arguments.file, arguments.target)
    except CatenaryError as error:
        report(error)
        return UNREADABLE
    print(as_json(found) if arguments.json else as_table(found))
    from catenary.machine import HARMLESS

    return SAME if all(each.verdict in HARMLESS for each in found) else DIFFERENT


def compare_with_segment(file: str, target: str | None) -> Sequence[Comparison]:
    """Compare a file with its segment, or with the segment of another target."""
    from catenary.machine import compare, read_machine
    from catenary.target import MainDevice, source_of

    expected = read_machine(file)
    source = expected.source() if target is None else source_of(target)
    with MainDevice(source, force=True) as main:
        note_other_masters(main)
        return compare(expected.tables.device, main.passive_scan())


def as_table(found: Sequence[Comparison]) -> str:
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


def as_json(found: Sequence[Comparison]) -> str:
    """Return the comparisons as JSON."""
    from catenary.machine import address, expected_identity

    return json.dumps(
        [
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
        ],
        indent=2,
    )

"""`catenary check`: compare the devices of a segment with a machine file, or with their ESIs."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import position
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_json, note_other_masters

if TYPE_CHECKING:
    from catenary.link import LinkSource
    from catenary.machine import Comparison
    from catenary.machine.file import MachineFile

SAME, DIFFERENT, UNREADABLE = 0, 1, 2


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "check",
        help="compare a segment with a machine file or with ESI files",
        description="Compares the addresses and identities of the devices with a machine file, "
        "and changes no device.\n"
        "With --against, compares each device with its ESI: identity, EEPROM, mailbox, "
        "SyncManagers, FMMUs, PDOs, clocks and objects. A device in INIT or PRE-OP is brought to "
        "PRE-OP to read its objects, and back; a device in another state keeps it, and only its "
        "EEPROM is compared. Nothing is written to an object.\n"
        "Exit status: 0 if they match, 1 if they differ, 2 if a file or the segment cannot be "
        "read. Differences from an ESI that are only warnings do not change the exit status.",
        example="catenary check machine.toml\ncatenary check machine.toml eth1 --json\n"
        "catenary check eth0 --against drive.xml --position 2\n"
        "catenary check eth0 --against",
    )
    parser.add_argument(
        "file",
        metavar="FILE",
        help="the machine file; with --against, it can be a target: eth0 ...",
    )
    parser.add_argument(
        "target",
        metavar="TARGET",
        nargs="?",
        help="target instead of the one in the file: eth0 ...",
    )
    _add_esi_options(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def _add_esi_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--against",
        metavar="ESI",
        nargs="?",
        const="",
        help="compare with an ESI file or a folder; without a value, with your library "
        "(`catenary esi`)",
    )
    parser.add_argument(
        "--position",
        metavar="N",
        type=position,
        help="compare only the device at this position with its ESI",
    )
    parser.add_argument(
        "--objects",
        action="store_true",
        help="also compare the whole object dictionary, which can take a minute per device",
    )
    parser.add_argument(
        "--passive", action="store_true", help="change no state: compare only the EEPROM"
    )


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.failure import report
    from catenary.errors import CatenaryError

    if arguments.against is None:
        _refuse_esi_options(arguments)
    try:
        if arguments.against is not None:
            from catenary.cli.check_esi import run as run_esi

            return run_esi(arguments)
        found = compare_with_segment(arguments.file, arguments.target)
    except CatenaryError as error:
        report(error)
        return UNREADABLE
    print(as_json(found) if arguments.json else as_table(found))
    return status_of(found)


def _refuse_esi_options(arguments: argparse.Namespace) -> None:
    for given, option in (
        (arguments.position is not None, "--position"),
        (arguments.objects, "--objects"),
        (arguments.passive, "--passive"),
    ):
        if given:
            raise UsageError(
                f"{option} needs --against", hint="catenary check eth0 --against drive.xml"
            )


def status_of(found: Sequence[Comparison]) -> int:
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
    return json.dumps(as_values(found), indent=2)


def as_values(found: Sequence[Comparison]) -> list[dict[str, object]]:
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

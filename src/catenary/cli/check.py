"""`catenary check`: compare the devices of a segment with a machine file, or with their ESIs."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import position
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_json

UNREADABLE = 2


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
        help="compare with an ESI file or a folder; without a value, with those of the machine "
        "file, or with your library (`catenary esi`)",
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
            from catenary.cli import check_esi

            return check_esi.run(arguments)
        from catenary.cli import check_machine

        return check_machine.run(arguments)
    except CatenaryError as error:
        report(error)
        return UNREADABLE


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

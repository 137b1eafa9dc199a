"""`catenary check`: compare devices with a machine file, their ESIs or a clone."""

from __future__ import annotations

import argparse
from enum import Enum, auto
from pathlib import Path

from catenary.cli.arguments import place
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_json

UNREADABLE = 2
DESCRIPTION = (
    "Compares the addresses and identities of the devices with a machine file, "
    "and changes no device.\n"
    "With --against line/, compares the devices with a clone, and reports what has changed "
    "since it was made: devices, wiring, EEPROMs, registers, mappings, objects and error "
    "counters. The devices are read as by `catenary clone`: devices in SAFE-OP and OP are not "
    "written to, and devices in INIT are brought to PRE-OP only with --pre-op. FILE can be a "
    "clone, too.\n"
    "With --against machine.toml, compares with a machine file, and names the drives and "
    "process data that a difference affects.\n"
    "With --against drive.xml, compares each device with its ESI: identity, EEPROM, mailbox, "
    "SyncManagers, FMMUs, PDOs, clocks and objects. A device in INIT or PRE-OP is brought to "
    "PRE-OP to read its objects, and back; a device in another state keeps it, and only its "
    "EEPROM is compared. Nothing is written to an object.\n"
    "Exit status: 0 if they match, 1 if they differ, 2 if a file or a part of the segment "
    "cannot be read. Differences that are only warnings or info do not change the exit status."
)
EXAMPLE = (
    "catenary check machine.toml\ncatenary check machine.toml eth1 --json\n"
    "catenary check eth0 --against line/ --pre-op\n"
    "catenary check line/ --against other/\n"
    "catenary check eth0 --against machine.toml\n"
    "catenary check eth0 --against drive.xml --position 2\n"
    "catenary check eth0 --against"
)


class Reference(Enum):
    """Kind of the value of --against."""

    NONE = auto()
    ESI = auto()
    MACHINE = auto()
    CLONE = auto()


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "check",
        help="compare a segment with a machine file, a clone or ESI files",
        description=DESCRIPTION,
        example=EXAMPLE,
    )
    parser.add_argument(
        "file",
        metavar="FILE",
        help="the machine file; with --against, it can be a target (eth0 ...) or a clone (line/)",
    )
    parser.add_argument(
        "target",
        metavar="TARGET",
        nargs="?",
        help="target instead of the one in the file: eth0 ...",
    )
    _add_esi_options(parser)
    _add_clone_options(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def _add_esi_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--against",
        metavar="FILE",
        nargs="?",
        const="",
        help="compare with a clone (line/), a machine file (*.toml), or an ESI file or a folder of "
        "them; without a value, with the ESIs of the machine file, or with your library "
        "(`catenary esi`)",
    )
    parser.add_argument(
        "--position",
        metavar="N",
        type=place,
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


def _add_clone_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--pre-op",
        action="store_true",
        help="bring devices in INIT to PRE-OP to compare their objects with a clone, and back",
    )
    parser.add_argument(
        "--all",
        action="store_true",
        help="also list values that change by themselves: mapped or read-only objects",
    )


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.failure import report
    from catenary.errors import CatenaryError

    try:
        reference = reference_of(arguments.against)
        _refuse_options(arguments, reference)
        return _run(arguments, reference)
    except CatenaryError as error:
        report(error)
        return UNREADABLE


def reference_of(against: str | None) -> Reference:
    """Return the kind of the value of --against."""
    from catenary.line.reader import is_clone

    if against is None:
        return Reference.NONE
    if against and is_clone(against):
        return Reference.CLONE
    return Reference.MACHINE if against.endswith(".toml") else Reference.ESI


def _run(arguments: argparse.Namespace, reference: Reference) -> int:
    if reference is Reference.CLONE:
        from catenary.cli import check_line

        return check_line.run(arguments)
    if reference is Reference.MACHINE:
        from catenary.cli import check_roles

        return check_roles.run(arguments)
    if Path(arguments.file).is_dir():
        raise UsageError(
            f"{arguments.file} is a folder: it is compared with a clone or a machine file",
            hint=f"catenary check TARGET --against {arguments.file}",
        )
    if reference is Reference.ESI:
        from catenary.cli import check_esi

        return check_esi.run(arguments)
    from catenary.cli import check_machine

    return check_machine.run(arguments)


_OF_ESI = "catenary check eth0 --against drive.xml"
_OF_CLONE = "catenary check eth0 --against line/"


def _refuse_options(arguments: argparse.Namespace, reference: Reference) -> None:
    """Raise UsageError for an option of another comparison."""
    for given, option, kind, example in (
        (arguments.position is not None, "--position", Reference.ESI, _OF_ESI),
        (arguments.objects, "--objects", Reference.ESI, _OF_ESI),
        (arguments.passive, "--passive", Reference.ESI, _OF_ESI),
        (arguments.pre_op, "--pre-op", Reference.CLONE, _OF_CLONE),
        (arguments.all, "--all", Reference.CLONE, _OF_CLONE),
    ):
        if given and kind is not reference:
            name = "an ESI" if kind is Reference.ESI else "a clone"
            raise UsageError(f"{option} needs --against with {name}", hint=f"{example} {option}")

"""`catenary esi add|find|show|list|remove|make`: vendors' device descriptions (ESI files)."""

from __future__ import annotations

import argparse
from pathlib import Path

from catenary.cli.esi_make import add_make
from catenary.cli.parsers import Commands, add_command, add_json

NAME_HELP = "order code, part of a name, or VENDOR:PRODUCT[:REVISION] in decimal or as 0x1F"
EXAMPLE = """\
catenary esi add Beckhoff_EtherCAT_XML.zip
catenary esi find EL2004
catenary esi show EL2004 --pdos"""


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "esi",
        help="use vendors' device descriptions (ESI files)",
        description="Manages a library of device descriptions: ESI files (XML) of vendors. The "
        "library is in ~/.local/share/catenary/esi, or in the folder CATENARY_ESI.",
        example=EXAMPLE,
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_add(group)
    _add_find(group)
    _add_show(group)
    _add_list(group)
    _add_remove(group)
    add_make(group)


def _add_library(parser: argparse.ArgumentParser, *, files: bool = True) -> None:
    more = ", a folder with ESI files, or one ESI file" if files else ""
    parser.add_argument(
        "--library", metavar="PATH", help=f"folder of the library{more} (default: your own library)"
    )


def _add_add(group: Commands) -> None:
    adding = add_command(
        group,
        "add",
        help="add ESI files, folders or ZIP archives",
        description="Adds files and folders to the library. They stay where they are. The XML "
        "files of a ZIP archive are extracted into the library. Run it again after you edited a "
        "file. Exit status 1 if a path contains no description.",
        example="catenary esi add drive.xml\ncatenary esi add ~/esi Beckhoff_EtherCAT_XML.zip",
    )
    adding.add_argument(
        "paths", metavar="FOLDER|FILE|ZIP", nargs="+", type=Path, help="what to add"
    )
    _add_library(adding, files=False)
    add_json(adding)
    adding.set_defaults(run=run_add)


def _add_find(group: Commands) -> None:
    finding = add_command(
        group,
        "find",
        help="find devices by name or numbers",
        description="Lists descriptions by order code, by a part of the name, or by numbers. With "
        "a revision, shows the one that Catenary uses for this device: the same revision, or else "
        "the newest one that is not above it. Exit status 1 if there is none.",
        example="catenary esi find EL2004\ncatenary esi find 0x2:0x07D43052:0x00120000",
    )
    finding.add_argument("name", metavar="NAME|VENDOR:PRODUCT[:REVISION]", help=NAME_HELP)
    _add_library(finding)
    add_json(finding)
    finding.set_defaults(run=run_find)


def _add_show(group: Commands) -> None:
    showing = add_command(
        group,
        "show",
        help="show the description of a device",
        description="Shows identity, SyncManagers, PDOs, mailbox, OpModes, slots, and what the "
        "reader found wrong in the file, with its line.",
        example="catenary esi show EL2004\ncatenary esi show 0x2:0x07D43052 --pdos --objects\n"
        "catenary esi show EL2004 --library EL2xxx.xml",
    )
    showing.add_argument("name", metavar="NAME|KEY", help=NAME_HELP)
    showing.add_argument("--pdos", action="store_true", help="show the entries of all PDOs")
    showing.add_argument("--objects", action="store_true", help="show the object dictionary")
    _add_library(showing)
    add_json(showing)
    showing.set_defaults(run=run_show)


def _add_list(group: Commands) -> None:
    listing = add_command(
        group,
        "list",
        help="list all devices, or all files",
        description="Lists the devices of the library, or its files with what is wrong in them.",
        example="catenary esi list\ncatenary esi list --files --check",
    )
    listing.add_argument("--files", action="store_true", help="list the files")
    listing.add_argument(
        "--check",
        action="store_true",
        help="compare every file with the index by content, and report devices in several files",
    )
    _add_library(listing)
    add_json(listing)
    listing.set_defaults(run=run_list)


def _add_remove(group: Commands) -> None:
    removing = add_command(
        group,
        "remove",
        help="remove files and folders from the library",
        description="Removes paths from the library. Your files are not deleted; only the "
        "extracted files of a ZIP archive are.",
        example="catenary esi remove drive.xml",
    )
    removing.add_argument(
        "paths", metavar="PATH", nargs="+", type=Path, help="path, as `esi list --files` shows it"
    )
    _add_library(removing, files=False)
    add_json(removing)
    removing.set_defaults(run=run_remove)


def run_add(arguments: argparse.Namespace) -> int:
    from catenary.cli import esi_commands

    return esi_commands.add(arguments)


def run_find(arguments: argparse.Namespace) -> int:
    from catenary.cli import esi_commands

    return esi_commands.find(arguments)


def run_show(arguments: argparse.Namespace) -> int:
    from catenary.cli import esi_commands

    return esi_commands.show(arguments)


def run_list(arguments: argparse.Namespace) -> int:
    from catenary.cli import esi_commands

    return esi_commands.list_all(arguments)


def run_remove(arguments: argparse.Namespace) -> int:
    from catenary.cli import esi_commands

    return esi_commands.remove(arguments)

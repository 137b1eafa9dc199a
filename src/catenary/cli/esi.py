"""`catenary esi add|find|show|list|remove`: vendors' device descriptions (ESI files)."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.parsers import Commands, add_command, add_json

if TYPE_CHECKING:
    from catenary.errors import EsiError
    from catenary.esi.device import EsiDevice
    from catenary.esi.library import Added, Library
    from catenary.esi.lookup import Choice
    from catenary.esi.record import Record

KEY = re.compile(r"(?:0x)?[0-9a-f]+(?::(?:0x)?[0-9a-f]+){1,2}", re.IGNORECASE)
SHOWN = 10  # products in a message
NAME_HELP = "order code, or VENDOR:PRODUCT[:REVISION] in decimal or as 0x1F"
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


def _add_library(parser: argparse.ArgumentParser, *, files: bool = True) -> None:
    more = ", or one with ESI files, or one ESI file" if files else ""
    parser.add_argument(
        "--library", metavar="PATH", help=f"folder of the library{more} (default: your own)"
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
    removing.set_defaults(run=run_remove)


def open_library(path: str | None) -> Library:
    """Return the library of an option: the user's own, a library folder, or other ESI files."""
    from catenary.esi.library import Library

    if path is None:
        return Library()
    library = Library(path)
    if library.path.is_file() or (library.path.is_dir() and not library.sources):
        return Library.of(path)
    return library


def run_add(arguments: argparse.Namespace) -> int:
    from catenary.cli.failure import report
    from catenary.errors import EsiError
    from catenary.esi.library import Library

    status = 0
    with Library(arguments.library) as library:
        for path in arguments.paths:
            try:
                status |= print_added(library.add(path))
            except EsiError as error:  # the other paths are added
                status = report(error)
    return status


def print_added(added: Added) -> int:
    """Print the result of one path, and return the exit status."""
    from catenary.cli.text import escaped

    counts = [(len(added.files), "file"), (added.devices, "device"), (added.modules, "module")]
    counts.append((added.dictionaries, "dictionary file"))
    text = ", ".join(f"{n} {noun}{'s' * (n != 1)}" for n, noun in counts if n or noun == "device")
    print(escaped(f"{added.path}: {text}"))
    for problem in (*added.problems, *(w for file in added.files for w in file.warnings)):
        print(f"catenary: {escaped(str(problem))}", file=sys.stderr)
    if added.devices + added.modules + added.dictionaries:
        return 0
    print(f"catenary: {escaped(added.path)}: no description found", file=sys.stderr)
    return 1


def run_find(arguments: argparse.Namespace) -> int:
    with open_library(arguments.library) as library:
        key = key_of(arguments.name)
        if key is None:
            records = library.search(arguments.name)
            choice = None
        else:
            choice = library.choose(*key)
            records = list(choice.candidates) if choice is not None else []
            if choice is not None and len(key) == 3:
                records = list(choice.records)
        if not records:
            raise not_found(library, arguments.name, choice)
        if choice is not None and len(key or ()) == 3:
            print(f"note: {choice.rule}", file=sys.stderr)
        print_records(records, as_json=arguments.json)
    return 0


def key_of(text: str) -> tuple[int, ...] | None:
    """Return the numbers of VENDOR:PRODUCT[:REVISION]; None for a name."""
    text = text.replace("#x", "0x")
    if not KEY.fullmatch(text):
        return None
    try:
        return tuple(int(part, 0) for part in text.split(":"))
    except ValueError:  # hexadecimal digits without 0x
        return tuple(int(part.lower().removeprefix("0x"), 16) for part in text.split(":"))


def not_found(library: Library, name: str, choice: Choice | None) -> EsiError:
    """Return the error for a name or key without description, with the nearest ones."""
    from catenary.errors import EsiLookupError
    from catenary.esi.library import ADD_HINT

    if choice is not None:
        shown = tuple(f"0x{each.entry.revision:08X}" for each in choice.candidates)
        return EsiLookupError(
            f"no description fits {name}: only newer revisions: {', '.join(shown)}",
            file=str(library.path),
            candidates=tuple(str(each) for each in choice.candidates),
            hint="add the vendor's file for this revision, or give one of these revisions",
        )
    near = library.near(name)
    guess = f"did you mean {', '.join(near)}? Otherwise, " if near else ""
    empty = "" if library.records() else "; the library has no devices"
    return EsiLookupError(
        f"no description of {name}{empty}", file=str(library.path), hint=guess + ADD_HINT
    )


def print_records(records: Sequence[Record], *, as_json: bool) -> None:
    """Print devices as a table or as JSON.

    Args:
        records: Entries of the library.
        as_json: True for JSON.
    """
    from catenary.cli.tables import table

    if as_json:
        print(json.dumps([record_values(each) for each in records], indent=2))
        return
    rows: list[tuple[str, ...]] = [("type", "name", "vendor", "product", "revision", "file")]
    for each in records:
        numbers = [f"0x{number:08X}" for number in each.key]
        name = " ".join(each.entry.name.split())
        rows.append((each.entry.type, name, *numbers, str(each.source)))
    print(table(rows))


def record_values(record: Record) -> dict[str, object]:
    entry = record.entry
    return {
        "type": entry.type,
        "name": entry.name,
        "vendor": entry.vendor,
        "product": entry.product,
        "revision": entry.revision,
        "check_revision": entry.revision_check.value,
        "file": record.path,
        "line": entry.line,
    }


def run_show(arguments: argparse.Namespace) -> int:
    from catenary.cli.esi_text import device_lines, device_values

    with open_library(arguments.library) as library:
        device = the_device(library, arguments.name)
    if arguments.json:
        print(json.dumps(device_values(device), indent=2))
        return 0
    print("\n".join(device_lines(device, pdos=arguments.pdos, objects=arguments.objects)))
    return 0


def the_device(library: Library, name: str) -> EsiDevice:
    """Return the only product with a name or key, in its newest or given revision.

    Raises:
        EsiLookupError: No product, or several products have this name.
    """
    from catenary.errors import EsiLookupError
    from catenary.esi.library import newest

    key = key_of(name)
    if key is not None:
        found = library.find(*key)
        if found is None:
            raise not_found(library, name, None)
        return found
    records = newest(library.search(name))
    if len(records) == 1:
        found = library.find(*records[0].key, order=records[0].entry.type)
    elif records:
        shown = [f"{each.entry.type} {each.key}" for each in records]
        more = ", ..." if len(shown) > SHOWN else ""
        raise EsiLookupError(
            f"{len(records)} products match {name!r}: {', '.join(shown[:SHOWN])}{more}",
            file=str(library.path),
            candidates=tuple(shown),
            hint="give the numbers: catenary esi show VENDOR:PRODUCT:REVISION",
        )
    else:
        found = None
    if found is None:
        raise not_found(library, name, None)
    return found


def run_list(arguments: argparse.Namespace) -> int:
    from catenary.cli.text import escaped

    with open_library(arguments.library) as library:
        problems = library.check() if arguments.check else library.problems
        if arguments.files:
            print_files(library, as_json=arguments.json)
        else:
            found = sorted(library.records(), key=lambda each: (each.entry.type, each.key))
            print_records(found, as_json=arguments.json)
    for problem in problems:
        print(f"catenary: {escaped(str(problem))}", file=sys.stderr)
    return int(bool(problems))


def print_files(library: Library, *, as_json: bool) -> None:
    """Print the files with their warnings.

    Args:
        library: The library.
        as_json: True for JSON.
    """
    from catenary.cli.text import escaped

    if as_json:
        rows = [
            {"file": each.path, "warnings": [str(warning) for warning in each.warnings]}
            for each in library.files
        ]
        print(json.dumps({"sources": [str(s) for s in library.sources], "files": rows}, indent=2))
        return
    for source in library.sources:
        print(escaped(f"{source}"))
    for each in library.files:
        print(escaped(f"  {each.path}"))
        for warning in each.warnings:
            print(escaped(f"    line {warning.source.line}: {warning.message}"))


def run_remove(arguments: argparse.Namespace) -> int:
    from catenary.esi.library import Library

    with Library(arguments.library) as library:
        for path in arguments.paths:
            library.remove(path)
            print(f"removed {path}")
    return 0

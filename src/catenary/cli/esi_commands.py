"""Actions of the commands of `catenary esi`."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Sequence

from catenary.cli.esi_text import device_lines, device_values
from catenary.cli.failure import report
from catenary.cli.tables import table
from catenary.cli.text import escaped
from catenary.errors import EsiError, EsiLookupError
from catenary.esi.device import EsiDevice
from catenary.esi.library import ADD_HINT, Added, Library
from catenary.esi.lookup import Choice, newest
from catenary.esi.record import Record

KEY = re.compile(r"(?:0x)?[0-9a-f]+(?::(?:0x)?[0-9a-f]+){1,2}", re.IGNORECASE)
SHOWN = 10  # products in a message


def open_library(path: str | None) -> Library:
    """Return the library of an option: the user's own, a library folder, or other ESI files."""
    if path is None:
        return Library()
    library = Library(path)
    if library.path.is_file() or (library.path.is_dir() and not library.sources):
        return Library.of(path)
    return library


def add(arguments: argparse.Namespace) -> int:
    status, done = 0, []
    with Library(arguments.library) as library:
        for path in arguments.paths:
            try:
                added = library.add(path)
            except EsiError as error:  # the other paths are added
                status = report(error)
                continue
            done.append(added_values(added))
            status |= print_added(added, as_json=arguments.json)
    if arguments.json:
        print(json.dumps(done, indent=2))
    return status


def added_values(added: Added) -> dict[str, object]:
    return {
        "path": added.path,
        "files": [each.path for each in added.files],
        "devices": added.devices,
        "modules": added.modules,
        "dictionaries": added.dictionaries,
    }


def print_added(added: Added, *, as_json: bool) -> int:
    """Print the result of one path, and return the exit status.

    Args:
        added: The result.
        as_json: True prints only warnings; the caller prints the result as JSON.
    """
    counts = [(len(added.files), "file"), (added.devices, "device"), (added.modules, "module")]
    counts.append((added.dictionaries, "dictionary file"))
    text = ", ".join(f"{n} {noun}{'s' * (n != 1)}" for n, noun in counts if n or noun == "device")
    if not as_json:
        print(escaped(f"{added.path}: {text}"))
    for problem in (*added.problems, *(w for file in added.files for w in file.warnings)):
        print(f"catenary: {escaped(str(problem))}", file=sys.stderr)
    if added.devices + added.modules + added.dictionaries:
        return 0
    print(f"catenary: {escaped(added.path)}: no description found", file=sys.stderr)
    print("  hint: check the path; to remove it: catenary esi remove PATH", file=sys.stderr)
    return 1


def find(arguments: argparse.Namespace) -> int:
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


def show(arguments: argparse.Namespace) -> int:
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


def list_all(arguments: argparse.Namespace) -> int:
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


def remove(arguments: argparse.Namespace) -> int:
    with Library(arguments.library) as library:
        for path in arguments.paths:
            library.remove(path)
            if not arguments.json:
                print(f"removed {path}")
    if arguments.json:
        print(json.dumps({"removed": list(map(str, arguments.paths))}, indent=2))
    return 0

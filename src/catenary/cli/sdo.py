"""`catenary sdo read|write|list`: access the object dictionary of a device."""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING

from catenary.cli import share_target
from catenary.cli.arguments import Entry, entry, output_file
from catenary.cli.failure import UsageError, one_line
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_position,
    add_target,
)
from catenary.cli.sdo_value import (
    as_text,
    data_type,
    documented_value,
    explain,
    meaning,
    parse_value,
    write_bytes,
)
from catenary.cli.share_target import names_share
from catenary.cli.text import escaped

if TYPE_CHECKING:
    from catenary.remote.messages import SdoValue
    from catenary.types import Value


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "sdo",
        help="read, write or list the objects of a device",
        description="Reads or writes one entry of a device's object dictionary (CoE SDO), or lists "
        "all entries.",
        example="catenary sdo read eth0 2 0x1018:1 --type UDINT\n"
        "catenary sdo write eth0 2 0x6065 5000 --type UDINT\n"
        "catenary sdo list eth0 2 --values",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_read(group)
    _add_write(group)
    _add_list(group)


def _add_read(group: Commands) -> None:
    reading = add_command(
        group,
        "read",
        help="read an object",
        description="Reads one entry. Without --type, the type comes from the device's ESI file. "
        "If there is none, prints the bytes and a likely meaning. With --complete, reads all "
        "subindices of the object in one transfer.",
        example="catenary sdo read eth0 2 0x1018:1 --type UDINT\n"
        "catenary sdo read virtual 2 0x1008 --type STRING --json\n"
        "catenary sdo read eth0 2 0x1018 --complete",
    )
    _add_place(reading)
    _add_type(reading)
    _add_complete(reading, "read")
    reading.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=output_file,
        help="write the bytes to FILE; - is stdout",
    )
    add_json(reading)
    reading.set_defaults(run=run_read)


def _add_write(group: Commands) -> None:
    writing = add_command(
        group,
        "write",
        help="write an object",
        description="Writes one entry. With --complete, writes all subindices of the object in "
        "one transfer. The VALUE - is read from stdin: bytes as they are with --type BYTES, text "
        "with any other type.",
        example="catenary sdo write eth0 2 0x6065 5000 --type UDINT\n"
        "catenary sdo write eth0 2 0x1011:1 0x64616f6c --type UDINT\n"
        "catenary sdo write eth0 2 0x1C12 '01 00 00 16' --type BYTES --complete",
    )
    _add_place(writing)
    writing.add_argument(
        "value",
        metavar="VALUE",
        help="value: decimal or 0x... number, text, or hexadecimal bytes; - is stdin",
    )
    _add_type(writing)
    _add_complete(writing, "write")
    add_json(writing)
    writing.set_defaults(run=run_write)


def _add_list(group: Commands) -> None:
    listing = add_command(
        group,
        "list",
        help="list all objects",
        description="Lists the index, type, access and name of all entries in the object "
        "dictionary, as the device describes them. The access is r, w or both. If it is limited "
        "to some states, their letters follow (P: PRE-OP, S: SAFE-OP, O: OP). R and T mark entries "
        "that can be mapped into RxPDOs and TxPDOs.",
        example="catenary sdo list eth0 2\ncatenary sdo list virtual 2 --values --json",
    )
    _add_device(listing)
    listing.add_argument(
        "--values", action="store_true", help="also read the values of all readable entries"
    )
    add_json(listing)
    listing.set_defaults(run=run_list)


def _add_device(parser: argparse.ArgumentParser) -> None:
    add_target(parser)
    add_position(parser)
    add_force(parser)


def _add_place(parser: argparse.ArgumentParser) -> None:
    _add_device(parser)
    parser.add_argument(
        "entry", metavar="INDEX[:SUB]", type=entry, help="entry, such as 0x6041 or 0x1018:1"
    )


def _add_type(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--type", metavar="T", help="data type: UDINT, INT, REAL, STRING, BYTES, ..."
    )


def _add_complete(parser: argparse.ArgumentParser, verb: str) -> None:
    parser.add_argument(
        "--complete", action="store_true", help=f"{verb} all subindices (complete access)"
    )


def run_read(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    kind = data_type(arguments.type)
    at: Entry = arguments.entry
    _check_complete(arguments)
    if arguments.json and arguments.output == "-":
        raise UsageError("--json needs -o FILE", hint="stdout has only one of JSON and bytes")
    if names_share(arguments.target):
        return _show(arguments, share_target.sdo_read(arguments))
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = device_at(main.scan(strict=False), arguments.position)
        arguments.position = device.position
        data = device.sdo.read(at.index, at.subindex, complete=arguments.complete)
        known = device.description.documented_object(at.index, at.subindex)
    if arguments.output is not None:
        write_bytes(arguments.output, data)
        if not arguments.json:
            return 0
    value = kind.decode(data) if kind else None
    if kind is None and known is not None and not arguments.complete:
        value = documented_value(known, data)
    if arguments.json:
        print(_as_json(arguments, data, value))
    else:
        print(as_text(data, value) + meaning(known, value))
    return 0


def run_write(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    kind = data_type(arguments.type)
    _check_complete(arguments)
    if names_share(arguments.target):
        written = share_target.sdo_write(arguments)
        return _show(arguments, written) if arguments.json else 0
    if kind is None:
        raise UsageError(
            "sdo write needs --type", hint="add --type UDINT, or --type BYTES for hexadecimal bytes"
        )
    value = parse_value(kind, arguments.value)
    at: Entry = arguments.entry
    data = kind.encode(value)
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = device_at(main.scan(strict=False), arguments.position)
        arguments.position = device.position
        device.sdo.write(at.index, at.subindex, data, complete=arguments.complete)
    if arguments.json:
        print(_as_json(arguments, data, value))
    return 0


def _check_complete(arguments: argparse.Namespace) -> None:
    """Raise UsageError for options that need the device itself, or do not fit together."""
    of_share = names_share(arguments.target)
    if of_share and (arguments.complete or getattr(arguments, "output", None) is not None):
        raise UsageError("--complete and --output need the device itself, not a running program")
    if arguments.complete and arguments.entry.subindex > 1:
        raise UsageError(
            f"complete access begins with subindex 0 or 1, not {arguments.entry.subindex}"
        )


def run_list(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.cli.dictionary import as_json, as_lines, rows_of
    from catenary.target import MainDevice

    if names_share(arguments.target):
        return share_target.sdo_list(arguments)
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = device_at(main.scan(strict=False), arguments.position)
        notes: list[str] = []
        rows = rows_of(device, notes, values=arguments.values)
        if arguments.json:
            print(as_json(rows))
        else:
            # Print each line immediately, because a large dictionary takes seconds.
            for line in as_lines(rows):
                print(line)
    for note in notes:
        print(f"note: {one_line(note)}", file=sys.stderr)
    return 0


def _show(arguments: argparse.Namespace, found: SdoValue) -> int:
    """Print the value that the program of a share has read."""
    if arguments.json:
        print(_as_json(arguments, found.data, found.value))
    else:
        print(explain(found.data) if found.value is None else escaped(found.text))
    return 0


def _as_json(arguments: argparse.Namespace, data: bytes, value: Value | None) -> str:
    return json.dumps(
        {
            "position": arguments.position,
            "index": arguments.entry.index,
            "subindex": arguments.entry.subindex,
            "type": arguments.type,
            "data": data.hex(),
            "value": value.hex() if isinstance(value, bytes) else value,
        }
    )

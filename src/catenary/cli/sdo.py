"""`catenary sdo read|write|list`: access the object dictionary of a device."""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING

from catenary.cli import share_target
from catenary.cli.arguments import Entry, entry, position
from catenary.cli.failure import UsageError, one_line
from catenary.cli.parsers import Commands, add_command, add_force, add_json, add_target
from catenary.cli.share_target import names_share
from catenary.cli.text import escaped

if TYPE_CHECKING:
    from catenary.model.device import ObjectInformation
    from catenary.remote.messages import SdoValue
    from catenary.types import DataType, Value

NUMBER_SIZES = (1, 2, 4, 8)  # sizes of numbers [bytes]


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
        "If there is none, prints the bytes and a likely meaning.",
        example="catenary sdo read eth0 2 0x1018:1 --type UDINT\n"
        "catenary sdo read virtual 2 0x1008 --type STRING --json",
    )
    _add_place(reading)
    _add_type(reading)
    add_json(reading)
    reading.set_defaults(run=run_read)


def _add_write(group: Commands) -> None:
    writing = add_command(
        group,
        "write",
        help="write an object",
        description="Writes one entry.",
        example="catenary sdo write eth0 2 0x6065 5000 --type UDINT\n"
        "catenary sdo write eth0 2 0x1011:1 0x64616f6c --type UDINT",
    )
    _add_place(writing)
    writing.add_argument(
        "value", metavar="VALUE", help="value: decimal or 0x... number, text, or hexadecimal bytes"
    )
    _add_type(writing)
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
    parser.add_argument(
        "position", metavar="POSITION", type=position, help="position of the device, from 0"
    )
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


def run_read(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    kind = _data_type(arguments.type)
    at: Entry = arguments.entry
    if names_share(arguments.target):
        return _show(arguments, share_target.sdo_read(arguments))
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = device_at(main.scan(strict=False), arguments.position)
        data = device.sdo.read(at.index, at.subindex)
        known = device.description.documented_object(at.index, at.subindex)
    value = kind.decode(data) if kind else None
    if kind is None and known is not None:
        value = documented_value(known, data)
    if arguments.json:
        print(_as_json(arguments, data, value))
    else:
        print(as_text(data, value) + meaning(known, value))
    return 0


def run_write(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    kind = _data_type(arguments.type)
    if names_share(arguments.target):
        written = share_target.sdo_write(arguments)
        return _show(arguments, written) if arguments.json else 0
    if kind is None:
        raise UsageError(
            "sdo write needs --type", hint="add --type UDINT, or --type BYTES for hexadecimal bytes"
        )
    try:
        value = kind.parse(arguments.value)
    except ValueError as error:
        raise UsageError(str(error), hint="write numbers as decimal or 0x...") from error
    at: Entry = arguments.entry
    data = kind.encode(value)
    with MainDevice(arguments.target, force=arguments.force) as main:
        device_at(main.scan(strict=False), arguments.position).sdo.write(
            at.index, at.subindex, data
        )
    if arguments.json:
        print(_as_json(arguments, data, value))
    return 0


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


def _data_type(name: str | None) -> DataType[Value] | None:
    from difflib import get_close_matches

    from catenary.types import ALL, by_name

    if name is None:
        return None
    try:
        return by_name(name)
    except ValueError as error:
        near = get_close_matches(name.upper(), [kind.name for kind in ALL], n=1, cutoff=0.5)
        guess = f"did you mean {near[0]}? " if near else ""
        hint = f"{guess}types: BOOL, SINT, INT, DINT, USINT, UINT, UDINT, REAL, STRING, BYTES, ..."
        raise UsageError(f"unknown data type {name!r}", hint=hint) from error


def as_text(data: bytes, value: Value | None) -> str:
    """Return the value as text, with the control characters of a string escaped."""
    if value is None:
        return explain(data)
    return escaped(value) if isinstance(value, str) else str(value)


def documented_value(known: ObjectInformation, data: bytes) -> Value | None:
    """Return the value by the data type in the ESI of the device; None if it does not fit."""
    from catenary.errors import DecodeError
    from catenary.types import by_index

    try:
        return by_index(known.data_type).decode(data)
    except (ValueError, DecodeError):
        return None


def meaning(known: ObjectInformation | None, value: Value | None) -> str:
    """Return the unit and the name of a value in the ESI, such as " mV" or "  (CSP)"."""
    if known is None or value is None:
        return ""
    text = dict(known.enumeration).get(value) if isinstance(value, int) else None
    return f" {known.unit}" * bool(known.unit) + f"  ({text})" * bool(text)


def explain(data: bytes) -> str:
    """Return bytes of unknown type as hexadecimal digits, and as a likely number or text."""
    if len(data) in NUMBER_SIZES:
        number = int.from_bytes(data, "little")
        return f"{data.hex(' ')}  (0x{number:0{2 * len(data)}X}, {number})"
    text = data.rstrip(b"\x00")
    if text and all(0x20 <= byte < 0x7F for byte in text):
        return f"{data.hex(' ')}  ({text.decode()!r})"
    return data.hex(" ")


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

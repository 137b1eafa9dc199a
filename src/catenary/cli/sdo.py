"""`catenary sdo read|write`: entries of a device's object dictionary."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from catenary.cli.arguments import Entry, entry, position
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_json

if TYPE_CHECKING:
    from catenary.types import DataType, Value

NUMBER_SIZES = (1, 2, 4, 8)  # bytes that are most likely one number


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "sdo",
        help="read or write an object of a device",
        description="Reads or writes one entry of a device's object dictionary (CoE SDO).",
        example="catenary sdo read eth0 2 0x1018:1 --type UDINT\n"
        "catenary sdo write eth0 2 0x6065 5000 --type UDINT",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    reading = add_command(
        group,
        "read",
        help="read an object",
        description="Reads one entry. Without --type: its bytes, and what they may mean.",
        example="catenary sdo read eth0 2 0x1018:1 --type UDINT\n"
        "catenary sdo read virtual 2 0x1008 --type STRING --json",
    )
    _add_place(reading)
    _add_type(reading)
    add_json(reading)
    reading.set_defaults(run=run_read)
    writing = add_command(
        group,
        "write",
        help="write an object",
        description="Writes one entry.",
        example="catenary sdo write eth0 2 0x6065 5000 --type UDINT\n"
        "catenary sdo write eth0 2 0x1011:1 0x64616f6c --type UDINT",
    )
    _add_place(writing)
    writing.add_argument("value", metavar="VALUE", help="decimal, 0x..., text, or bytes as hex")
    _add_type(writing)
    add_json(writing)
    writing.set_defaults(run=run_write)


def _add_place(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("target", metavar="TARGET", help="eth0, virtual or virtual:FILE.toml")
    parser.add_argument("position", metavar="POSITION", type=position, help="0 is the first device")
    parser.add_argument("entry", metavar="INDEX[:SUB]", type=entry, help="0x6041, 0x1018:1")


def _add_type(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--type", metavar="T", help="UDINT, INT, REAL, STRING, BYTES, ...")


def run_read(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.target import open_main_device

    kind = _data_type(arguments.type)
    at: Entry = arguments.entry
    with open_main_device(arguments.target) as main:
        device = device_at(main.scan(), arguments.position)
        data = device.sdo.read(at.index, at.subindex)
    value = kind.decode(data) if kind else None
    if arguments.json:
        print(_as_json(arguments, data, value))
    else:
        print(value if value is not None else explain(data))
    return 0


def run_write(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.target import open_main_device

    kind = _data_type(arguments.type)
    if kind is None:
        raise UsageError("sdo write needs --type", hint="--type UDINT, or --type BYTES for hex")
    try:
        value = kind.parse(arguments.value)
    except ValueError as error:
        raise UsageError(str(error)) from error
    at: Entry = arguments.entry
    data = kind.encode(value)
    with open_main_device(arguments.target) as main:
        device_at(main.scan(), arguments.position).sdo.write(at.index, at.subindex, data)
    if arguments.json:
        print(_as_json(arguments, data, value))
    return 0


def _data_type(name: str | None) -> DataType[Value] | None:
    from catenary.types import by_name

    try:
        return by_name(name) if name else None
    except ValueError as error:
        raise UsageError(str(error)) from error


def explain(data: bytes) -> str:
    """Bytes without a type: as hex, and as the number or text that they may be."""
    meanings = []
    if len(data) in NUMBER_SIZES:
        meanings.append(f"unsigned {int.from_bytes(data, 'little')}")
    text = data.rstrip(b"\x00")
    if text and all(0x20 <= byte < 0x7F for byte in text):
        meanings.append(f"text {text.decode()!r}")
    return f"{data.hex(' ')}" + (f"  ({', '.join(meanings)})" if meanings else "")


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

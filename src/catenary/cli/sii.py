"""`catenary sii read|show|write|build`: access the EEPROM of a device, or its image in a file."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from catenary.cli.arguments import positive_number
from catenary.cli.failure import UsageError
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_json,
    add_position,
    add_target,
    note_other_masters,
)
from catenary.cli.sii_build import add_build
from catenary.cli.sii_write import add_write

DUMP_WIDTH = 16


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "sii",
        help="read, write or build the EEPROM of a device",
        description="Reads, writes or builds the EEPROM (SII) of a device, which contains its "
        "identity and describes its mailbox and process data.",
        example="catenary sii read eth0 2 --text\ncatenary sii show drive.bin\n"
        "catenary sii write eth0 2 drive.bin --dry-run\n"
        "catenary sii build drive.xml -o drive.bin",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_read(group)
    _add_show(group)
    add_write(group)
    add_build(group)


def _add_read(group: Commands) -> None:
    reading = add_command(
        group,
        "read",
        help="read the whole EEPROM",
        description="Reads the whole EEPROM, even if its content is invalid, and checks it. "
        "Without options, prints it in hexadecimal.",
        example="catenary sii read eth0 2 -o drive.bin\ncatenary sii read eth0 2 --text",
    )
    add_target(reading)
    add_position(reading)
    reading.add_argument(
        "-o", "--output", metavar="FILE", help="write the bytes to FILE; - is stdout"
    )
    reading.add_argument("--text", action="store_true", help="print every field as text")
    reading.add_argument(
        "--bytes",
        metavar="N",
        type=positive_number,
        help="read N bytes instead of the size in the EEPROM",
    )
    add_json(reading)
    reading.set_defaults(run=run_read)


def _add_show(group: Commands) -> None:
    showing = add_command(
        group,
        "show",
        help="show an image from a file",
        description="Shows every field of an image from `sii read -o` or `sii build`, and checks "
        "it. No device is needed. Exit status 1 if the image is invalid.",
        example="catenary sii show drive.bin",
    )
    showing.add_argument("file", metavar="FILE", type=Path, help="file with the binary image")
    add_json(showing)
    showing.set_defaults(run=run_show)


def run_read(arguments: argparse.Namespace) -> int:
    from catenary.bus.eeprom import read_eeprom
    from catenary.cli.devices import device_at
    from catenary.cli.progress import Progress
    from catenary.procedure.sii_owner import with_eeprom
    from catenary.procedure.sii_size import read_extent
    from catenary.target import MainDevice
    from catenary.wire.sii_check import objections

    check_formats(arguments)
    with MainDevice(arguments.target, force=True) as main:  # this command only reads
        note_other_masters(main)
        station = device_at(main.passive_scan(names=False), arguments.position).station
        extent = main.converse(with_eeprom(station, read_extent(station)))
        size = min(arguments.bytes or extent.size, extent.limit) // 2 * 2
        with Progress("read") as progress:
            image = read_eeprom(main, station, size, progress=progress)
    deliver(arguments, image)
    notes = [extent.note] if extent.note else [each.text for each in objections(image)]
    if arguments.bytes is None:
        for note in notes:
            print(f"catenary: {station}: {note}", file=sys.stderr)
    return int(bool(notes) and arguments.bytes is None)


def check_formats(arguments: argparse.Namespace) -> None:
    """Raise UsageError if stdout would have two formats."""
    chosen = [arguments.json, arguments.text, arguments.output == "-"]
    if sum(chosen) > 1:
        raise UsageError(
            "--json, --text and -o - exclude each other", hint="use -o FILE for the bytes"
        )


def run_show(arguments: argparse.Namespace) -> int:
    from catenary.wire.sii_check import objections

    image = arguments.file.read_bytes()
    print(as_json(image) if arguments.json else "\n".join(as_text(image)))
    wrong = objections(image)
    for each in wrong:
        print(f"catenary: {arguments.file}: {each.text}\n  hint: {each.hint}", file=sys.stderr)
    return int(bool(wrong))


def as_json(image: bytes) -> str:
    from catenary.cli.sii_json import as_values

    return json.dumps(as_values(image), indent=2)


def deliver(arguments: argparse.Namespace, image: bytes) -> None:
    """Write the image to a file, or print it as text or as a dump."""
    if arguments.output == "-":
        sys.stdout.buffer.write(image)
    elif arguments.output is not None:
        Path(arguments.output).write_bytes(image)
    if arguments.json:
        print(as_json(image))
    elif arguments.text:
        print("\n".join(as_text(image)))
    elif arguments.output is None:
        print("\n".join(dump(image)))


def as_text(image: bytes) -> list[str]:
    from catenary.cli.sii_text import text_lines, tolerant
    from catenary.errors import DecodeError

    try:
        return text_lines(tolerant(image))
    except DecodeError as error:
        return [f"invalid image: {error.message}"]


def dump(image: bytes) -> list[str]:
    """Return a hexadecimal dump with text. Repeated lines become "*", as in hexdump."""
    lines: list[str] = []
    before = None
    for start in range(0, len(image), DUMP_WIDTH):
        row = image[start : start + DUMP_WIDTH]
        if row == before and lines[-1] != "*":
            lines.append("*")
        elif row != before:
            text = "".join(chr(byte) if 0x20 <= byte < 0x7F else "." for byte in row)
            lines.append(f"{start:06x}  {row.hex(' '):<47}  {text}")
        before = row
    return [*lines, f"{len(image):06x}"]

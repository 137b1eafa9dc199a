"""`catenary clone TARGET`: copy everything that the devices of a segment report into a folder."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import positive_seconds
from catenary.cli.parsers import Commands, add_command, add_json, add_target

if TYPE_CHECKING:
    from catenary.line import ClonedDevice, Line

SECONDS = 600.0  # for the objects of one device


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "clone",
        help="copy what the devices of a segment report into a folder",
        description="Reads registers, EEPROMs, object dictionaries with values, mappings, clocks "
        "and error counters of all devices, and writes them as text files. No state is changed "
        "without --pre-op. Devices in SAFE-OP, OP and BOOT are not written to: only their "
        "registers are read. An interrupted clone continues; a complete one is read again. "
        "Exit status 1 if a part is missing; the folder has the reason.",
        example="catenary clone eth0 -o line/ --pre-op\ncatenary clone eth0 -o line/ --fresh",
    )
    add_target(parser)
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", type=Path, required=True, help="folder of the clone"
    )
    parser.add_argument(
        "--pre-op",
        action="store_true",
        help="bring devices in INIT to PRE-OP to read their objects, then back to INIT",
    )
    parser.add_argument(
        "--fresh",
        action="store_true",
        help="replace the devices of the folder, even if parts of them cannot be read now",
    )
    parser.add_argument(
        "--without-serials", action="store_true", help="leave the serial numbers out"
    )
    parser.add_argument(
        "--seconds",
        metavar="N",
        type=positive_seconds,
        default=SECONDS,
        help=f"longest time for the objects of one device (default: {SECONDS:g})",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.failure import one_line
    from catenary.cli.progress import Progress
    from catenary.target import clone

    with Progress("read") as progress:
        line = clone(
            arguments.target,
            arguments.output,
            pre_op=arguments.pre_op,
            serials=not arguments.without_serials,
            fresh=arguments.fresh,
            objects_timeout=arguments.seconds,
            progress=progress.step,
        )
    print(as_json(line) if arguments.json else as_text(line))
    for device in line.devices:
        for part, reason in device.missing.items():
            where = f"device {device.position} ({device.name})"
            print(f"catenary: {one_line(f'{where}: {part}: {reason}')}", file=sys.stderr)
    for note in line.notes:
        print(f"note: {one_line(note)}", file=sys.stderr)
    return 0 if line.complete else 1


HEADINGS = ("pos", "name", "state", "EEPROM", "objects", "values", "refused")


def as_text(line: Line) -> str:
    from catenary.cli.tables import table

    return table([HEADINGS, *map(_row, line.devices)])


def _row(device: ClonedDevice) -> tuple[str, ...]:
    entries = [entry for each in device.objects for entry in each.entries]
    return (
        *(str(device.position), device.name, state_name(device)),
        "missing" if device.sii is None else f"{len(device.sii)} bytes",
        "missing" if "objects" in device.missing and not device.objects else _number(device),
        str(sum(entry.value is not None for entry in entries)),
        str(sum(entry.abort is not None for entry in entries)),
    )


def _number(device: ClonedDevice) -> str:
    return f"{len(device.objects)}{'...' if 'objects' in device.missing else ''}"


def state_name(device: ClonedDevice) -> str:
    from catenary.errors import DecodeError
    from catenary.wire.al import AlStatus

    try:
        status = AlStatus.from_word(device.al_status)
    except DecodeError:
        return f"state {device.al_status & 0xF}"
    return f"{status.state} with an error" if status.error else str(status.state)


def as_json(line: Line) -> str:
    return json.dumps(
        {
            "complete": line.complete,
            "notes": line.notes,
            "devices": [
                {
                    "position": device.position,
                    "name": device.name,
                    "state": state_name(device),
                    "sii_bytes": None if device.sii is None else len(device.sii),
                    "objects": len(device.objects),
                    "missing": device.missing,
                    "notes": device.notes,
                }
                for device in line.devices
            ],
        },
        indent=2,
    )

"""`catenary init TARGET`: write a machine file from a segment, or print its JSON schema."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import result_file
from catenary.cli.parsers import Commands, add_command, add_json

if TYPE_CHECKING:
    from catenary.bus import SubDevice


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "init",
        help="write a machine file from the devices of a segment, or from an ENI",
        description="Brings all devices to PRE-OP and writes machine.toml with the identities of "
        "the devices, the drives, and the names of process data. Lines marked FILL IN need your "
        "values. An ENI (bus.xml) is converted without a network. With --schema, prints the JSON "
        "schema of machine files for editors.",
        example="catenary init eth0 -o machine.toml\ncatenary init bus.xml -o machine.toml\n"
        "catenary init --schema",
    )
    parser.add_argument(
        "target",
        metavar="TARGET",
        nargs="?",
        help="eth0, virtual, virtual:FILE.toml ..., or an ENI: bus.xml",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=result_file,
        default=Path("machine.toml"),
        help="file to write (machine.toml)",
    )
    parser.add_argument("--force", action="store_true", help="overwrite the file")
    parser.add_argument("--schema", action="store_true", help="print the JSON schema and exit")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.failure import UsageError

    if arguments.schema:
        from catenary.machine.schema import json_schema

        print(json.dumps(json_schema(), indent=2, ensure_ascii=False))
        return 0
    if arguments.target is None:
        raise UsageError("TARGET is missing", hint="for example: catenary init eth0")
    if arguments.output.exists() and not arguments.force:
        raise UsageError(f"{arguments.output} already exists", hint="use -o FILE or --force")
    if arguments.target.lower().endswith(".xml"):
        return convert(arguments)
    return write(arguments)


def convert(arguments: argparse.Namespace) -> int:
    """Write the machine file of an ENI, and print what it cannot contain. Return the status."""
    from catenary.esi.eni import read_eni
    from catenary.machine.eni.text import eni_text

    eni = read_eni(arguments.target)
    text, notes = eni_text(eni)
    arguments.output.write_text(text, encoding="utf-8")
    print_result(arguments, text, len(eni.devices))
    for note in (*map(str, eni.warnings), *notes):
        print(f"warning: {note}", file=sys.stderr)
    return 0


def write(arguments: argparse.Namespace) -> int:
    """Write the file and print the lines to fill in. Return the exit status."""
    from catenary.cli.devices import report_failures
    from catenary.machine.text import machine_text
    from catenary.target import MainDevice

    target, output = arguments.target, arguments.output
    with MainDevice(target) as main:
        devices = main.scan(strict=False)
        encoders = read_encoders(devices)
    text = machine_text(
        [device.description for device in devices], target_in_file(target, output), encoders
    )
    output.write_text(text, encoding="utf-8")
    print_result(arguments, text, len(devices))
    return report_failures(devices)


def print_result(arguments: argparse.Namespace, text: str, devices: int) -> None:
    """Print the number of devices, and the lines that need a value.

    Args:
        arguments: Arguments of the command.
        text: Text of the machine file.
        devices: Number of devices.
    """
    from catenary.machine.text import FILL_IN

    output = arguments.output
    lines = [n for n, line in enumerate(text.splitlines(), 1) if f"# {FILL_IN}" in line]
    if arguments.json:
        print(json.dumps({"file": str(output), "devices": devices, "fill_in": lines}, indent=2))
        return
    print(f"{output}: {devices} devices")
    for number in lines:
        print(f"{output}:{number}: {FILL_IN}")


def read_encoders(devices: Sequence[SubDevice]) -> Mapping[tuple[int, int], float]:
    """Return the reported encoder counts per turn (0x608F) by (position, slot)."""
    from catenary.errors import CatenaryError
    from catenary.machine.text import ENCODER
    from catenary.types import UDINT
    from catenary.wire.cia402 import SLOT_OFFSET

    found: dict[tuple[int, int], float] = {}
    for device in devices:
        for slot in device.slots:
            try:
                counts, turns = (
                    device.sdo.read(index + SLOT_OFFSET * slot, subindex, type=UDINT)
                    for index, subindex in ENCODER
                )
            except CatenaryError:
                continue  # the object is optional; the line stays without a value
            if counts and turns:
                found[device.position, slot] = counts / turns
    return found


def target_in_file(target: str, output: Path) -> str:
    """Return the target as written in the file, with a path relative to the folder of the file."""
    from catenary.target import named_target
    from catenary.target.toml_file import VIRTUAL

    target = named_target(target)
    kind, colon, name = target.partition(":")
    if kind not in VIRTUAL or not colon:
        return target
    return f"{kind}:{os.path.relpath(name, output.parent)}"

"""`catenary esi make TARGET POSITION`: make an ESI file from a device."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from catenary.cli.arguments import output_file
from catenary.cli.failure import UsageError
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_position,
    add_target,
)


def add_make(group: Commands) -> None:
    making = add_command(
        group,
        "make",
        help="make an ESI file from a device",
        description="Brings all devices to PRE-OP and makes an ESI file (XML) from what a device "
        "reports: identity, SyncManagers, FMMUs, PDOs, mailbox, clock modes and EEPROM. Use the "
        "vendor's file if you have it: it also has the object dictionary, units and texts.",
        example="catenary esi make eth0 2 -o drive.xml\ncatenary esi make eth0 2 | less",
    )
    add_target(making)
    add_position(making)
    making.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=output_file,
        default="-",
        help="file to write; - is stdout (default)",
    )
    add_force(making)
    add_json(making)
    making.set_defaults(run=run_make)


def run_make(arguments: argparse.Namespace) -> int:
    from catenary.bus.eeprom import read_eeprom
    from catenary.cli.devices import device_at
    from catenary.cli.sii_text import tolerant
    from catenary.esi.writer import esi_text
    from catenary.procedure.sii_owner import with_eeprom
    from catenary.procedure.sii_size import read_extent
    from catenary.target import MainDevice

    if arguments.json and arguments.output == "-":
        raise UsageError("--json needs -o FILE", hint="stdout has only one of JSON and XML")
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = device_at(main.scan(strict=False), arguments.position)
        if device.error is not None:
            raise device.error
        extent = main.converse(with_eeprom(device.station, read_extent(device.station)))
        image = read_eeprom(main, device.station, extent.size)
        description = device.description
    text = esi_text(description, tolerant(image), image)
    if arguments.output == "-":
        sys.stdout.write(text)
        return 0
    Path(arguments.output).write_text(text, encoding="utf-8")
    pdos = len(description.output_pdos) + len(description.input_pdos)
    if arguments.json:
        found = {"file": arguments.output, "position": description.position, "pdos": pdos}
        print(json.dumps(found, indent=2))
    else:
        print(f"{arguments.output}: {device.station}, {pdos} PDOs")
    return 0

"""`catenary sii build`: build the image of an EEPROM from a vendor's ESI file."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from catenary.cli.arguments import number
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_json


def add_build(group: Commands) -> None:
    building = add_command(
        group,
        "build",
        help="build an image from an ESI file",
        description="Builds the EEPROM image (SII) of a device from its ESI file (XML). Notes name "
        "what an SII cannot contain. No device is needed.",
        example="catenary sii build drive.xml -o drive.bin\n"
        "catenary sii build terminals.xml --device EL2004 --serial 7 -o el2004.bin\n"
        "catenary sii show drive.bin",
    )
    building.add_argument("file", metavar="FILE", type=Path, help="ESI file (XML)")
    building.add_argument(
        "--device",
        metavar="NAME|PRODUCT[:REVISION]",
        default="",
        help="device in the file; needed if it has several",
    )
    building.add_argument(
        "--serial", metavar="N", type=number, default=0, help="serial number (default 0)"
    )
    building.add_argument(
        "--alias", metavar="N", type=number, help="station alias (default: that of the file)"
    )
    building.add_argument(
        "--pdos",
        choices=("named", "unnamed", "absent"),
        default="named",
        help="for a small EEPROM: unnamed omits the names of PDOs and entries, absent all PDOs "
        "(default named)",
    )
    building.add_argument(
        "-o", "--output", metavar="OUT", required=True, help="write the image to OUT; - is stdout"
    )
    add_json(building)
    building.set_defaults(run=run_build)


def run_build(arguments: argparse.Namespace) -> int:
    from catenary.esi.reader import read_esi
    from catenary.esi.selection import select_device
    from catenary.esi.sii import assemble_sii

    if arguments.json and arguments.output == "-":
        raise UsageError("--json and -o - exclude each other", hint="use -o FILE for the image")
    device = select_device(read_esi(arguments.file), arguments.device)
    build = assemble_sii(
        device,
        serial=arguments.serial,
        alias=arguments.alias,
        pdos=arguments.pdos,
    )
    for note in build.notes:
        print(f"note: {device.source}: {note}", file=sys.stderr)
    if arguments.output == "-":
        sys.stdout.buffer.write(build.image)
        return 0
    Path(arguments.output).write_bytes(build.image)
    used = len(build.image.rstrip(b"\xff"))
    if arguments.json:
        sizes = {"used": used, "size": len(build.image)}
        found = {"file": arguments.output, "device": str(device), **sizes}
        print(json.dumps(found | {"notes": list(map(str, build.notes))}, indent=2))
        return 0
    print(f"{arguments.output}: {device}\n{used} of {len(build.image)} bytes used")
    return 0

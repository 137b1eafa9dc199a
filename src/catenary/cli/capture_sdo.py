"""`catenary capture sdo`: the objects that a master wrote to a device, as a start-up list."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import position
from catenary.cli.parsers import Commands, add_command, add_json

if TYPE_CHECKING:
    from catenary.capture import Device
    from catenary.capture.start_up_list import StartUpList
    from catenary.cli.capture_json import Json

DONE, NOT_FOUND, UNREADABLE = 0, 1, 2
FORMATS = ("machine", "python")


def add_to(group: Commands) -> None:
    parser = add_command(
        group,
        "sdo",
        help="export the objects that a master wrote to a device",
        description="Prints the SDO writes of the bring-up of one device as a start-up list. "
        "Paste it into the table [[device]] of a machine file. The PDO mapping is not part of "
        "such a list: it is printed as a comment. Exit status 1 if the capture does not show the "
        "device, 2 if it cannot be read.",
        example="catenary capture sdo twincat.pcapng --device 1 --format machine\n"
        "catenary capture sdo twincat.pcapng --device 1 --format python",
    )
    parser.add_argument("file", metavar="FILE", help="pcapng or pcap file")
    parser.add_argument(
        "--device",
        metavar="N",
        type=position,
        required=True,
        help="the device at position N, or with station address N",
    )
    parser.add_argument(
        "--format",
        choices=FORMATS,
        default=FORMATS[0],
        help="`machine` for a machine file (default), `python` for cat.StartUp",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the list. Return 0, 1 or 2; see the help."""
    from catenary.capture.compared_master import ComparedMaster
    from catenary.capture.start_up_list import start_up_list
    from catenary.capture.start_up_text import machine_text, python_text
    from catenary.cli.capture_diff import print_notes, read

    timeline = read(arguments.file)
    if timeline is None:
        return UNREADABLE
    master = ComparedMaster(timeline)
    wanted = arguments.device
    device = _chosen(master.devices, wanted)
    if device is None:
        known = ", ".join(map(str, master.devices)) or "none"
        print(f"catenary: {arguments.file}: no device {wanted}; devices: {known}", file=sys.stderr)
        return NOT_FOUND
    print_notes(arguments.file, timeline, sys.stderr)
    found = start_up_list(master, device)
    if arguments.json:
        print(json.dumps(_as_object(found), indent=2))
    else:
        text = machine_text if arguments.format == "machine" else python_text
        print(text(found, Path(arguments.file).name), end="")
    return DONE


def _chosen(devices: tuple[Device, ...], wanted: int) -> Device | None:
    """Return the device at a position, else the one with this station address."""
    at_position = (each for each in devices if each.position == wanted)
    return next(at_position, None) or next((d for d in devices if d.station == wanted), None)


def _as_object(found: StartUpList) -> dict[str, Json]:
    return {
        "device": found.device.position,
        "station": found.device.station,
        "start_up": [
            {
                "object": f"0x{each.index:04X}:{each.subindex:02X}",
                "data": each.data.hex(),
                "value": each.value,
                "before_mapping": each.before_mapping,
                "verify": each.verify,
                "complete_access": each.complete_access,
                "step": str(each.step),
                "packet": each.packet,
            }
            for each in found.entries
        ],
        "pdos": {
            f"0x{number:04X}": None
            if mapped is None
            else [[each.index, each.subindex, each.bits] for each in mapped]
            for number, mapped in found.pdos.items()
        },
        "omitted": list(found.omitted),
    }

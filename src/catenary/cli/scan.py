"""`catenary scan TARGET`: list the devices of a segment."""

from __future__ import annotations

import argparse
import sys

from catenary.cli import share_target
from catenary.cli.parsers import Commands, add_command, add_force, add_json, add_target


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "scan",
        help="list the devices of a segment",
        description="Brings all devices to PRE-OP and lists them.",
        example="catenary scan eth0\ncatenary scan virtual --json",
    )
    add_target(parser)
    add_force(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import as_json, as_table, report_failures
    from catenary.cli.failure import one_line
    from catenary.target import MainDevice

    if share_target.names_share(arguments.target):
        return share_target.scan(arguments)
    with MainDevice(arguments.target, force=arguments.force) as main:
        devices = main.scan(strict=False)
        print(as_json(devices) if arguments.json else as_table(devices))
    for note in main.notes:
        print(f"note: {one_line(note)}", file=sys.stderr)
    return report_failures(devices)

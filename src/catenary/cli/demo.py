"""`catenary demo`: three drives follow a sine."""

from __future__ import annotations

import argparse
from pathlib import Path

from catenary.cli.arguments import positive_seconds
from catenary.cli.parsers import Commands, add_command


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "demo",
        help="run three virtual drives that follow a sine at 1 kHz",
        description="Runs three virtual servo drives that follow a sine at 1 kHz, with real "
        "EtherCAT frames in a private network. Prints the timing and writes demo.json and "
        "demo.html.",
        example="catenary demo\ncatenary demo --seconds 3 --out /tmp/demo",
    )
    parser.add_argument(
        "--seconds", type=positive_seconds, default=10.0, help="duration of the motion (10)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="folder of the report (out)"
    )
    parser.add_argument(
        "--in-process",
        action="store_true",
        help="run the segment in this process, without a network",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.demo import run_demo

    run_demo(arguments.seconds, arguments.out, in_process=arguments.in_process)
    return 0

"""`python -m benchmarks`: the commands."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from benchmarks.cli import protocols, table, with_wires, without_wires
from catenary.cli.main import Parser
from catenary.cli.main import main as run_command

PROGRAM = "python -m benchmarks"
DESCRIPTION = "Benchmarks of Catenary on virtual devices, next to C, PySOEM and published figures."
EPILOG = f"""\
example:
  {PROGRAM} loop --peers c,c-ring,pysoem
  {PROGRAM} scan --drives 100
  {PROGRAM} table pyigh --seconds 5
  {PROGRAM} soak --minutes 10 --seed 7
"""


def make_parser() -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = Parser(
        prog=PROGRAM,
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    group = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    with_wires.add_loop(group)
    with_wires.add_storm(group)
    with_wires.add_foe(group)
    with_wires.add_eoe(group)
    protocols.add_protocols(group)
    with_wires.add_share(group)
    with_wires.add_remote(group)
    with_wires.add_cost(group)
    with_wires.add_scan(group)
    without_wires.add_virtual(group)
    without_wires.add_tasks(group)
    without_wires.add_law(group)
    without_wires.add_ros2(group)
    without_wires.add_soak(group)
    without_wires.add_clocks(group)
    with_wires.add_networks(group)
    without_wires.add_igh(group)
    table.add_table(group)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; return its exit status, as `catenary` does."""
    return run_command(arguments, make_parser, program=PROGRAM)

"""What the parsers of all commands have in common."""

from __future__ import annotations

import argparse
import shutil
import sys
import textwrap
from typing import TYPE_CHECKING, TypeAlias

from catenary.cli.arguments import position

if TYPE_CHECKING:
    from catenary.bus import MainDevice

    Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
else:
    Commands = object


def add_command(
    commands: Commands, name: str, *, help: str, description: str, example: str
) -> argparse.ArgumentParser:
    """`description`: its lines are filled, blank ones and those that are indented stay."""
    parser = commands.add_parser(
        name,
        help=help,
        description=filled(description),
        epilog="example:\n" + textwrap.indent(example, "  "),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(parser=parser)
    return parser


def filled(text: str) -> str:
    """As wide as the terminal, like what argparse writes itself."""
    width = shutil.get_terminal_size().columns - 2
    lines = text.splitlines()
    return "\n".join(line if line.startswith(" ") else textwrap.fill(line, width) for line in lines)


def add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON, for programs")


def add_target(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "target", metavar="TARGET", help="eth0, virtual, machine.toml ...: catenary --help"
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--force", action="store_true", help="though another master uses the interface"
    )


def note_other_masters(main: MainDevice) -> None:
    """Print a note on stderr if another master drives the line that this command reads."""
    for other in main.other_masters:
        print(f"note: {other}; this command only reads", file=sys.stderr)


def add_position(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("position", metavar="POSITION", type=position, help="0 is the first device")

"""Common parts of the parsers of all commands."""

from __future__ import annotations

import argparse
import shutil
import sys
import textwrap
from typing import TYPE_CHECKING, TypeAlias

from catenary.cli.arguments import number, place

if TYPE_CHECKING:
    from catenary.bus import MainDevice

    Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
else:
    Commands = object

POSITION_HELP = "position of the device, from 0; or @ALIAS"


def add_command(
    commands: Commands, name: str, *, help: str, description: str, example: str
) -> argparse.ArgumentParser:
    """Add a command to the parser.

    Args:
        commands: The group that receives the command.
        name: The name of the command.
        help: One line for the list of commands.
        description: Description in the help. Long lines are wrapped, except indented ones.
        example: Command lines at the end of the help.

    Returns:
        The parser of the command.
    """
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
    """Wrap lines to the width of the terminal, like argparse. Keep indented lines unchanged."""
    width = shutil.get_terminal_size().columns - 2
    lines = text.splitlines()
    return "\n".join(line if line.startswith(" ") else textwrap.fill(line, width) for line in lines)


def add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def add_target(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "target", metavar="TARGET", help="eth0, virtual, machine.toml ... (see catenary --help)"
    )


def add_uid(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--uid", type=number, help="user ID of the share's owner (default: yours, then root's)"
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--force", action="store_true", help="continue even if another master uses the interface"
    )


def note_other_masters(main: MainDevice) -> None:
    """Print a note on stderr if another master uses the segment that this command reads."""
    for other in main.other_masters:
        print(f"note: {other}; this command only reads", file=sys.stderr)


def add_position(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("position", metavar="POSITION", type=place, help=POSITION_HELP)


def add_optional_position(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "position",
        metavar="POSITION",
        nargs="?",
        type=place,
        help=f"{POSITION_HELP} (default: all devices)",
    )

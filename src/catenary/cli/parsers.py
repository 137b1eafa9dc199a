"""What the parsers of all commands have in common."""

from __future__ import annotations

import argparse
import textwrap
from typing import TYPE_CHECKING, TypeAlias

from catenary.cli.arguments import position

if TYPE_CHECKING:
    Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
else:
    Commands = object


def add_command(
    commands: Commands, name: str, *, help: str, description: str, example: str
) -> argparse.ArgumentParser:
    return commands.add_parser(
        name,
        help=help,
        description=description,
        epilog="example:\n" + textwrap.indent(example, "  "),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="print JSON, for programs")


def add_target(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("target", metavar="TARGET", help="eth0, virtual or virtual:FILE.toml")


def add_position(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("position", metavar="POSITION", type=position, help="0 is the first device")

"""`catenary include`: the folder of catenary_share.h."""

from __future__ import annotations

import argparse

from catenary.cli.parsers import Commands, add_command


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "include",
        help="print the folder of the C header catenary_share.h",
        description="Prints the folder of catenary_share.h and catenary_share.c. With these files, "
        "a program in C, C++ or C# reads a share and commands its axes:\n"
        "  cc -pthread program.c $(catenary include)/catenary_share.c -I$(catenary include)",
        example="catenary include",
    )
    parser.set_defaults(run=run)


def run(_: argparse.Namespace) -> int:
    from catenary.share.include import include_folder

    print(include_folder())
    return 0

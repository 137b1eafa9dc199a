"""`catenary top SHARE`: axes, bus and events of a running loop in a terminal."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import share_name
from catenary.cli.parsers import Commands, add_command, add_uid


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "top",
        help="show the axes, bus and events of a running loop",
        description="Shows the axes, the bus and the events of a loop from its share "
        "(Loop(..., sink=cat.Share(NAME))), also over ssh. Press q to quit. Press s twice within "
        "2 s for a quick stop of all axes; this is not an emergency stop (ISO 13850). If the loop "
        "ends, the page waits until it returns. Needs catenary[top].",
        example="catenary top arm\nssh -t robot catenary top arm",
    )
    parser.add_argument("share", metavar="SHARE", type=share_name, help="name of the loop's share")
    add_uid(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.monitor.extra import require
    from catenary.monitor.source import Source

    require("textual", "top")
    from catenary.monitor.top import Top

    source = Source(arguments.share, arguments.uid)
    try:
        Top(source).run()
    finally:
        source.close()
    return 0

"""`catenary foxglove SHARE`: a running loop, live, for Foxglove and PlotJuggler."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import number, share_name
from catenary.cli.parsers import Commands, add_command, add_uid
from catenary.cli.record import stopped_by_signals


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "foxglove",
        help="serve a running loop to Foxglove and PlotJuggler",
        description="Serves the cycles, events and diagnostics of a loop from its share "
        "(Loop(..., sink=cat.Share(NAME))) over a WebSocket. In Foxglove, open a connection of "
        "the kind Foxglove WebSocket to the printed address. Clients can only read. With --host, "
        "anyone who reaches the address can read. Ends on Ctrl-C. Needs catenary[foxglove].",
        example="catenary foxglove arm\ncatenary foxglove arm --port 9000",
    )
    parser.add_argument("share", metavar="SHARE", type=share_name, help="name of the loop's share")
    parser.add_argument("--host", default="127.0.0.1", help="address (default: this machine only)")
    parser.add_argument("--port", type=number, default=8765, help="TCP port (default: 8765)")
    add_uid(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.monitor.foxglove import FoxgloveServer

    options = {"host": arguments.host, "port": arguments.port, "uid": arguments.uid}
    with stopped_by_signals() as stop, FoxgloveServer(arguments.share, **options) as server:
        print(f"ws://{arguments.host}:{server.port}; press Ctrl-C to stop", flush=True)
        server.run(stop)
    return 0

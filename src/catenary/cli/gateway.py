"""`catenary gateway TARGET`: mailbox gateway for vendors' tools (ETG.8200)."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from catenary.cli.arguments import number, place
from catenary.cli.failure import UsageError
from catenary.cli.parsers import POSITION_HELP, Commands, add_command, add_force, add_target
from catenary.cli.record import stopped_by_signals
from catenary.cli.share_target import names_share

if TYPE_CHECKING:
    from catenary.bus import SubDevice

PORT = 0x88A4
CHECK = 0.1  # [s] between two checks for events


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "gateway",
        help="let vendors' tools reach the devices (mailbox gateway)",
        description="Serves the EtherCAT mailbox gateway (ETG.8200) over UDP and TCP, without a "
        "loop, until Ctrl-C. The devices stay in PRE-OP. Clients must run on this machine, or use "
        "an SSH tunnel. Clients read objects, their descriptions and "
        "files. --write also lets them write to a device. Beside a loop, use cat.Gateway in its "
        "program.",
        example="catenary gateway eth0\ncatenary gateway eth0 --write 2 --write @10",
    )
    add_target(parser)
    parser.add_argument(
        "--write",
        metavar="DEVICE",
        type=place,
        action="append",
        default=[],
        help=f"let clients write to this device: {POSITION_HELP}; may be repeated",
    )
    parser.add_argument(
        "--port", type=number, default=PORT, help="port of UDP and TCP (default: 34980)"
    )
    add_force(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.gateway import Gateway
    from catenary.target import MainDevice

    if names_share(arguments.target):
        raise UsageError(
            "a share does not forward mailbox messages",
            hint="use cat.Gateway(main) in the program of the loop (docs/how_to/gateway.md)",
        )
    if not 0 <= arguments.port <= 0xFFFF:
        raise UsageError(f"port {arguments.port} is outside 0 to 65535")
    with MainDevice(arguments.target, force=arguments.force) as main:
        subs = main.scan(strict=False)
        writable = [device_at(subs, each) for each in arguments.write]
        with (
            stopped_by_signals() as stop,
            Gateway(main, write=writable, port=arguments.port) as gateway,
        ):
            print(_addresses(subs, gateway.writable))
            print(f"gateway on 127.0.0.1, port {gateway.port}; press Ctrl-C to stop", flush=True)
            while not stop.wait(CHECK):
                _print_events(main.events)
            _print_events(main.events)
            print(f"{gateway.counts.requests} requests, {gateway.counts.refused} refused")
    return 0


def _addresses(subs: Sequence[SubDevice], writable: frozenset[int]) -> str:
    """Return the table of the devices with their addresses."""
    from catenary.cli.tables import table
    from catenary.cli.text import escaped

    rows = [
        (
            str(sub.position),
            escaped(sub.name),
            f"0x{sub.station.address:04X}",
            _access(sub, writable),
        )
        for sub in subs
    ]
    return table([("pos", "name", "address", "access"), *rows])


def _access(sub: SubDevice, writable: frozenset[int]) -> str:
    if sub.channel is None:
        return "no mailbox"
    return "read, write" if sub.position in writable else "read"


def _print_events(events: Iterable[object]) -> None:
    from catenary.cli.text import escaped

    for event in events:
        print(escaped(str(event)), flush=True)

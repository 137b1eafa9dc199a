"""`python -m benchmarks protocols`."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import positive_number
from catenary.cli.bench_options import add_file, add_seconds
from catenary.cli.parsers import Commands, add_command


def add_protocols(group: Commands) -> None:
    parser = add_command(
        group,
        "protocols",
        help="measure the delay of the cycle by each mailbox protocol",
        description="Run a loop of 1 kHz while a thread uses each mailbox protocol in turn, and "
        "none. Print the time from the wake-up to the send, its difference to the loop without a "
        "protocol, lost and late cycles, and the CPU time.",
        example="python -m benchmarks protocols --axes 33 --rounds 10 --seconds 2 "
        "--json protocols.json",
    )
    parser.add_argument(
        "--axes", type=positive_number, default=33, metavar="N", help="axes (default: 33)"
    )
    parser.add_argument(
        "--rounds",
        type=positive_number,
        default=10,
        metavar="N",
        help="rounds in which the protocols take turns (default: 10)",
    )
    add_seconds(parser, 2.0, "time of every protocol in a round")
    parser.add_argument(
        "--execution",
        choices=("threaded", "inline"),
        default="threaded",
        help="execution mode of the loop (default: threaded)",
    )
    add_file(parser)
    parser.set_defaults(run=run_protocols)


def run_protocols(arguments: argparse.Namespace) -> int:
    from benchmarks import protocols
    from catenary import bench

    bench.enter_private_network()
    protocols.measure(
        axes=arguments.axes,
        rounds=arguments.rounds,
        seconds=arguments.seconds,
        execution=arguments.execution,
        file=arguments.json,
    )
    return 0

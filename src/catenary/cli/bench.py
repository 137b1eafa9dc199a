"""`catenary bench`: measure this machine, and print a measurement again."""

from __future__ import annotations

import argparse

from catenary.cli.bench_options import add_loop_options
from catenary.cli.parsers import Commands, add_command


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "bench",
        help="measure the loop on this machine",
        description="Measures this machine. Comparisons with C, PySOEM and published figures are "
        "`python -m benchmarks` in a clone of the repository (docs/benchmarks.md).",
        example="catenary bench loop --seconds 10 --json loop.json",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_loop(group)


def _add_loop(group: Commands) -> None:
    parser = add_command(
        group,
        "loop",
        help="the cyclic exchange, phase by phase",
        description="Runs catenary-inline, catenary-threaded and catenary-law (where Numba is "
        "installed) in short rounds, in turn, on virtual devices in a private network. Prints "
        "output delay, input age and CPU time per cycle, then the phases.",
        example="catenary bench loop --seconds 10 --json loop.json\n"
        "catenary bench loop --drives 33 --rate 4000 --body pd\n"
        "catenary bench loop --busy-wait 0.00005",
    )
    add_loop_options(parser)
    parser.set_defaults(run=run_loop)


def run_loop(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.enter_private_network()
    from catenary.bench import loop  # imports NumPy

    setting = loop.Setting(
        drives=arguments.drives,
        rate=arguments.rate,
        seconds=arguments.seconds,
        body=arguments.body,
        spin=arguments.spin,
        rounds=arguments.rounds,
        busy_wait=arguments.busy_wait,
    )
    loop.measure(setting, arguments.json)
    return 0

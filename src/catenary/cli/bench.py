"""`catenary bench`: measures the loop beside its peers and the bring-up, on wires; the rest is in
`bench_without_wires.py` and `bench_table.py`."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import positive_number, positive_numbers, seconds
from catenary.cli.bench_options import add_drives, add_file, add_rate, add_seconds
from catenary.cli.bench_table import add_table
from catenary.cli.bench_without_wires import (
    add_clocks,
    add_igh,
    add_law,
    add_soak,
    add_tasks,
    add_virtual,
)
from catenary.cli.parsers import Commands, add_command


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "bench",
        help="measure the loop beside C and PySOEM",
        description="Measures on virtual devices, in a private network of its own.",
        example="catenary bench loop --peers c,c-ring,pysoem\ncatenary bench scan --drives 100",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_loop(group)
    _add_storm(group)
    _add_share(group)
    _add_cost(group)
    _add_scan(group)
    add_virtual(group)
    add_tasks(group)
    add_law(group)
    add_soak(group)
    add_clocks(group)
    _add_networks(group)
    add_igh(group)
    add_table(group)


def _add_loop(group: Commands) -> None:
    parser = add_command(
        group,
        "loop",
        help="the cyclic exchange, phase by phase",
        description="Runs catenary-inline, catenary-threaded, catenary-law (where Numba is "
        "installed) and the peers in short rounds, in turn, on the same segment with the same "
        "scheduling. Prints output delay, input age and CPU time per cycle, then the phases.",
        example="catenary bench loop --seconds 10 --peers c,c-ring,pysoem --json loop.json\n"
        "catenary bench loop --drives 33 --body pd --peers pysoem\n"
        "catenary bench loop --busy-wait 0.00005 --peers c,c-busy",
    )
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 10.0, "of every peer")
    parser.add_argument(
        "--peers",
        default="c,pysoem",
        metavar="A,B",
        help="of c, c-ring, c-busy, pysoem, catenary-law-storm (c,pysoem)",
    )
    parser.add_argument(
        "--body", choices=("sine", "pd"), default="sine", help="what the user computes (sine)"
    )
    parser.add_argument(
        "--spin", action="store_true", help="a Python thread spins beside every loop"
    )
    parser.add_argument(
        "--rounds",
        type=positive_number,
        metavar="N",
        help="of every peer, each in a fresh process (so many that each takes 0.9 s at 1 kHz)",
    )
    parser.add_argument(
        "--busy-wait",
        type=seconds,
        default=0.0,
        metavar="S",
        help="busy-wait of our loops and of c-busy before each cycle start [s] (0)",
    )
    add_file(parser)
    parser.set_defaults(run=run_loop)


def _add_storm(group: Commands) -> None:
    parser = add_command(
        group,
        "storm",
        help="the loop while objects of all devices are read all the time",
        description="Runs the loop with and without threads that read objects of all devices, in "
        "turn; then reads a large object on an idle bus, beside PySOEM.",
        example="catenary bench storm --drives 3 --seconds 10 --json storm.json",
    )
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 10.0, "of every way")
    add_file(parser)
    parser.set_defaults(run=run_storm)


def _add_share(group: Commands) -> None:
    parser = add_command(
        group,
        "share",
        help="what reading along takes, and costs the loop",
        description="Reads the newest cycle again and again beside a plain copy; runs the loop "
        "without a share, with one, and with 16 readers in processes of their own, in turn.",
        example="catenary bench share --seconds 5 --json share.json",
    )
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 5.0, "of every way")
    add_file(parser)
    parser.set_defaults(run=run_share)


def _add_cost(group: Commands) -> None:
    parser = add_command(
        group,
        "cost",
        help="what an axis and a byte cost",
        description="Measures segments that differ in axes and in bytes, and fits "
        "a + b·axes + c·bytes.",
        example="catenary bench cost --seconds 3",
    )
    add_seconds(parser, 3.0, "of every segment")
    add_file(parser)
    parser.set_defaults(run=run_cost)


def _add_scan(group: Commands) -> None:
    parser = add_command(
        group,
        "scan",
        help="bring-up: frames and time",
        description="Brings a segment to PRE-OP with Catenary and with PySOEM and counts frames.",
        example="catenary bench scan --drives 100",
    )
    add_drives(parser, 100)
    add_file(parser)
    parser.set_defaults(run=run_scan)


def _add_networks(group: Commands) -> None:
    parser = add_command(
        group,
        "networks",
        help="18 + 15 axes on two networks, beside C",
        description="Runs one loop over two networks, and two C programs on the same networks, in "
        "turn: cycles lost, instants missed. Then the loop in virtual time.",
        example="catenary bench networks --rates 4000,8000 --seconds 10 --json networks.json",
    )
    parser.add_argument(
        "--rates",
        type=positive_numbers,
        default="4000,8000",
        metavar="HZ,HZ",
        help="of the loops, one after the other (4000,8000)",
    )
    add_seconds(parser, 10.0, "of each")
    parser.add_argument(
        "--rounds",
        type=positive_number,
        default=5,
        metavar="N",
        help="in which the programs take turns, each in a fresh process (5)",
    )
    add_file(parser)
    parser.set_defaults(run=run_networks)


def run_loop(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.enter_private_network()
    bench.measure_loop(
        drives=arguments.drives,
        rate=arguments.rate,
        seconds=arguments.seconds,
        peers=[name for name in arguments.peers.split(",") if name],
        body=arguments.body,
        spin=arguments.spin,
        rounds=arguments.rounds,
        busy_wait=arguments.busy_wait,
        file=arguments.json,
    )
    return 0


def run_storm(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.enter_private_network()
    bench.measure_storm(
        drives=arguments.drives,
        rate=arguments.rate,
        seconds=arguments.seconds,
        file=arguments.json,
    )
    return 0


def run_share(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.enter_private_network()
    bench.measure_share(
        drives=arguments.drives,
        rate=arguments.rate,
        seconds=arguments.seconds,
        file=arguments.json,
    )
    return 0


def run_cost(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.enter_private_network()
    bench.measure_cost(seconds=arguments.seconds, file=arguments.json)
    return 0


def run_scan(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.enter_private_network()
    bench.measure_scan(drives=arguments.drives, file=arguments.json)
    return 0


def run_networks(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.enter_private_network()
    bench.measure_networks(
        rates=arguments.rates,
        seconds=arguments.seconds,
        rounds=arguments.rounds,
        file=arguments.json,
    )
    return 0

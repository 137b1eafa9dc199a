"""`python -m benchmarks`, what needs wires: the loop next to its peers, and the bring-up."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import positive_number, positive_numbers
from catenary.cli.bench_options import add_drives, add_file, add_loop_options, add_rate, add_seconds
from catenary.cli.parsers import Commands, add_command


def add_loop(group: Commands) -> None:
    parser = add_command(
        group,
        "loop",
        help="the cyclic exchange beside C and PySOEM, phase by phase",
        description="Runs catenary-inline, catenary-threaded, catenary-law (where Numba is "
        "installed) and the peers in short rounds, in turn, on the same segment with the same "
        "scheduling. Prints output delay, input age and CPU time per cycle, then the phases.",
        example="python -m benchmarks loop --seconds 10 --peers c,c-ring,pysoem --json loop.json\n"
        "python -m benchmarks loop --drives 33 --body pd --peers pysoem\n"
        "python -m benchmarks loop --busy-wait 0.00005 --peers c,c-busy",
    )
    add_loop_options(parser)
    parser.add_argument(
        "--peers",
        default="c,pysoem",
        metavar="A,B",
        help="of c, c-ring, c-busy, pysoem, catenary-law-storm (c,pysoem)",
    )
    parser.set_defaults(run=run_loop)


def add_storm(group: Commands) -> None:
    parser = add_command(
        group,
        "storm",
        help="the loop while objects of all devices are read all the time",
        description="Runs the loop with and without threads that read objects of all devices, in "
        "turn; then reads a large object on an idle bus, beside PySOEM.",
        example="python -m benchmarks storm --drives 3 --seconds 10 --json storm.json",
    )
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 10.0, "of every way")
    add_file(parser)
    parser.set_defaults(run=run_storm)


def add_share(group: Commands) -> None:
    parser = add_command(
        group,
        "share",
        help="what reading along takes, and costs the loop",
        description="Reads the newest cycle again and again beside a plain copy; runs the loop "
        "without a share, with one, and with 16 readers in processes of their own, in turn.",
        example="python -m benchmarks share --seconds 5 --json share.json",
    )
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 5.0, "of every way")
    add_file(parser)
    parser.set_defaults(run=run_share)


def add_cost(group: Commands) -> None:
    parser = add_command(
        group,
        "cost",
        help="what an axis and a byte cost",
        description="Measures segments that differ in axes and in bytes, and fits "
        "a + b·axes + c·bytes.",
        example="python -m benchmarks cost --seconds 3",
    )
    add_seconds(parser, 3.0, "of every segment")
    add_file(parser)
    parser.set_defaults(run=run_cost)


def add_scan(group: Commands) -> None:
    parser = add_command(
        group,
        "scan",
        help="bring-up: frames and time",
        description="Brings a segment to PRE-OP with Catenary and with PySOEM and counts frames.",
        example="python -m benchmarks scan --drives 100",
    )
    add_drives(parser, 100)
    add_file(parser)
    parser.set_defaults(run=run_scan)


def add_networks(group: Commands) -> None:
    parser = add_command(
        group,
        "networks",
        help="18 + 15 axes on two networks, beside C",
        description="Runs one loop over two networks, and two C programs on the same networks, in "
        "turn: cycles lost, instants missed. Then the loop in virtual time.",
        example="python -m benchmarks networks --rates 4000,8000 --seconds 10 --json networks.json",
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
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_loop(
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
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_storm(
        drives=arguments.drives,
        rate=arguments.rate,
        seconds=arguments.seconds,
        file=arguments.json,
    )
    return 0


def run_share(arguments: argparse.Namespace) -> int:
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_share(
        drives=arguments.drives,
        rate=arguments.rate,
        seconds=arguments.seconds,
        file=arguments.json,
    )
    return 0


def run_cost(arguments: argparse.Namespace) -> int:
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_cost(seconds=arguments.seconds, file=arguments.json)
    return 0


def run_scan(arguments: argparse.Namespace) -> int:
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_scan(drives=arguments.drives, file=arguments.json)
    return 0


def run_networks(arguments: argparse.Namespace) -> int:
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_networks(
        rates=arguments.rates,
        seconds=arguments.seconds,
        rounds=arguments.rounds,
        file=arguments.json,
    )
    return 0

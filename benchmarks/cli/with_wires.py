"""Commands of `python -m benchmarks` that need network interfaces."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import positive_number, positive_numbers
from catenary.cli.bench_options import add_drives, add_file, add_loop_options, add_rate, add_seconds
from catenary.cli.parsers import Commands, add_command


def add_loop(group: Commands) -> None:
    parser = add_command(
        group,
        "loop",
        help="compare the phases of a cycle with C and PySOEM",
        description="Run catenary-inline, catenary-threaded, catenary-law (if Numba is installed) "
        "and the peers in short rounds, in turn, on the same segment with the same scheduling. "
        "Print the output delay, the input age and the CPU time per cycle, then the phases.",
        example="python -m benchmarks loop --seconds 10 --peers c,c-ring,pysoem --json loop.json\n"
        "python -m benchmarks loop --drives 33 --body pd --peers pysoem\n"
        "python -m benchmarks loop --busy-wait 0.00005 --peers c,c-busy",
    )
    add_loop_options(parser)
    parser.add_argument(
        "--peers",
        default="c,pysoem",
        metavar="A,B",
        help="peers from c, c-ring, c-busy, pysoem, catenary-law-storm (default: c,pysoem)",
    )
    parser.set_defaults(run=run_loop)


def add_storm(group: Commands) -> None:
    parser = add_command(
        group,
        "storm",
        help="measure the loop during an SDO storm",
        description="Run the loop with and without threads that read objects of all devices, in "
        "turn. Then read a large object on an idle bus, with Catenary and with PySOEM.",
        example="python -m benchmarks storm --drives 3 --seconds 10 --json storm.json",
    )
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 10.0, "run time of every variant")
    add_file(parser)
    parser.set_defaults(run=run_storm)


def add_eoe(group: Commands) -> None:
    parser = add_command(
        group,
        "eoe",
        help="measure a web page through EoE next to 33 axes",
        description="Run a loop of 33 axes at 1 kHz, in turn without and with the transfer of a "
        "web page of one device through EoE. Print lost cycles, the rate, and its ratio to the "
        "bound that follows from the mailbox and the acyclic queue.",
        example="python -m benchmarks eoe --seconds 10 --rounds 5 --json eoe.json",
    )
    add_seconds(parser, 10.0, "run time of every run")
    parser.add_argument("--rounds", type=positive_number, default=3, help="rounds (default: 3)")
    add_file(parser)
    parser.set_defaults(run=run_eoe)


def add_foe(group: Commands) -> None:
    parser = add_command(
        group,
        "foe",
        help="measure the rate of file transfers",
        description="Write and read a file with Catenary and with PySOEM on an idle bus, in turn, "
        "then with Catenary next to a loop of 1 kHz. Print the rates, and their ratios to PySOEM "
        "and to the bound that follows from the mailbox and the acyclic queue.",
        example="python -m benchmarks foe --size 1048576 --rounds 5 --json foe.json",
    )
    parser.add_argument(
        "--size",
        type=positive_number,
        default=1 << 20,
        metavar="BYTES",
        help="size of the file (default: 1 MiB)",
    )
    parser.add_argument(
        "--rounds",
        type=positive_number,
        default=5,
        metavar="N",
        help="rounds in which the programs take turns, each in a new process (default: 5)",
    )
    add_file(parser)
    parser.set_defaults(run=run_foe)


def add_share(group: Commands) -> None:
    parser = add_command(
        group,
        "share",
        help="measure the time to read a share, and its cost for the loop",
        description="Measure reading the newest cycle from a share, compared with a plain copy. "
        "Then run the loop without a share, with one, and with 16 readers in separate processes, "
        "in turn.",
        example="python -m benchmarks share --seconds 5 --json share.json",
    )
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 5.0, "run time of every variant")
    add_file(parser)
    parser.set_defaults(run=run_share)


def add_remote(group: Commands) -> None:
    parser = add_command(
        group,
        "remote",
        help="measure the cost of remote requests for the loop",
        description="Run the loop with a share and a client that sends 200 requests per second, "
        "and with a client that sends nothing, in turn.",
        example="python -m benchmarks remote --seconds 5 --json remote.json",
    )
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 5.0, "run time of every variant")
    add_file(parser)
    parser.set_defaults(run=run_remote)


def add_cost(group: Commands) -> None:
    parser = add_command(
        group,
        "cost",
        help="measure the cost of an axis and of a byte",
        description="Measure segments with different numbers of axes and bytes, and fit "
        "a + b·axes + c·bytes.",
        example="python -m benchmarks cost --seconds 3",
    )
    add_seconds(parser, 3.0, "run time of every segment")
    add_file(parser)
    parser.set_defaults(run=run_cost)


def add_scan(group: Commands) -> None:
    parser = add_command(
        group,
        "scan",
        help="measure frames and time of the bring-up",
        description="Bring a segment to PRE-OP with Catenary and with PySOEM, and count frames.",
        example="python -m benchmarks scan --drives 100",
    )
    add_drives(parser, 100)
    add_file(parser)
    parser.set_defaults(run=run_scan)


def add_networks(group: Commands) -> None:
    parser = add_command(
        group,
        "networks",
        help="compare 18 + 15 axes on two networks with C",
        description="Run one loop over two networks, and two C programs on the same networks, in "
        "turn. Print the lost cycles and the missed cycle starts. Then run the loop in virtual "
        "time.",
        example="python -m benchmarks networks --rates 4000,8000 --seconds 10 --json networks.json",
    )
    parser.add_argument(
        "--rates",
        type=positive_numbers,
        default="4000,8000",
        metavar="HZ,HZ",
        help="rates of the loops, one after the other (default: 4000,8000)",
    )
    add_seconds(parser, 10.0, "run time of each")
    parser.add_argument(
        "--rounds",
        type=positive_number,
        default=5,
        metavar="N",
        help="rounds in which the programs take turns, each in a new process (default: 5)",
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


def run_eoe(arguments: argparse.Namespace) -> int:
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_eoe(seconds=arguments.seconds, rounds=arguments.rounds, file=arguments.json)
    return 0


def run_foe(arguments: argparse.Namespace) -> int:
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_foe(size=arguments.size, rounds=arguments.rounds, file=arguments.json)
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


def run_remote(arguments: argparse.Namespace) -> int:
    import benchmarks
    from catenary import bench

    bench.enter_private_network()
    benchmarks.measure_remote(
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

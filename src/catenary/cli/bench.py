"""`catenary bench`: measures the loop beside its peers, the bring-up, virtual time and
tasks."""

from __future__ import annotations

import argparse
from pathlib import Path

from catenary.cli.arguments import positive_number, positive_numbers, positive_seconds
from catenary.cli.bench_table import add_table
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
    _add_virtual(group)
    _add_tasks(group)
    _add_law(group)
    _add_soak(group)
    _add_clocks(group)
    _add_networks(group)
    _add_igh(group)
    add_table(group)


def _add_loop(group: Commands) -> None:
    parser = add_command(
        group,
        "loop",
        help="the cyclic exchange, phase by phase",
        description="Runs catenary-inline, catenary-threaded, catenary-law (where Numba is "
        "installed) and the peers in short rounds, one after the other, on the same segment with "
        "the same scheduling.",
        example="catenary bench loop --seconds 10 --peers c,c-ring,pysoem --json loop.json\n"
        "catenary bench loop --drives 33 --body pd --peers pysoem",
    )
    parser.add_argument("--drives", type=positive_number, default=3, metavar="N")
    parser.add_argument("--rate", type=positive_number, default=1000, metavar="HZ")
    parser.add_argument(
        "--seconds", type=positive_seconds, default=10.0, metavar="S", help="of every peer (10)"
    )
    parser.add_argument(
        "--peers",
        default="c,pysoem",
        metavar="A,B",
        help="of c, c-ring, pysoem, catenary-law-storm (c,pysoem)",
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
    _add_file(parser)
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
    parser.add_argument("--drives", type=positive_number, default=3, metavar="N")
    parser.add_argument("--rate", type=positive_number, default=1000, metavar="HZ")
    parser.add_argument(
        "--seconds", type=positive_seconds, default=10.0, metavar="S", help="of every way (10)"
    )
    _add_file(parser)
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
    parser.add_argument("--drives", type=positive_number, default=3, metavar="N")
    parser.add_argument("--rate", type=positive_number, default=1000, metavar="HZ")
    parser.add_argument(
        "--seconds", type=positive_seconds, default=5.0, metavar="S", help="of every way (5)"
    )
    _add_file(parser)
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
    parser.add_argument("--seconds", type=positive_seconds, default=3.0, metavar="S")
    _add_file(parser)
    parser.set_defaults(run=run_cost)


def _add_scan(group: Commands) -> None:
    parser = add_command(
        group,
        "scan",
        help="bring-up: frames and time",
        description="Brings a segment to PRE-OP with Catenary and with PySOEM and counts frames.",
        example="catenary bench scan --drives 100",
    )
    parser.add_argument("--drives", type=positive_number, default=100, metavar="N")
    _add_file(parser)
    parser.set_defaults(run=run_scan)


def _add_virtual(group: Commands) -> None:
    parser = add_command(
        group,
        "virtual",
        help="how much faster than real time a virtual segment runs",
        description="Runs a loop on a segment in this process, in virtual time.",
        example="catenary bench virtual --drives 3 --seconds 20",
    )
    parser.add_argument("--drives", type=positive_number, default=3, metavar="N")
    parser.add_argument(
        "--config", type=Path, metavar="FILE.toml", help="the drives of this segment, and its arm"
    )
    parser.add_argument(
        "--seconds", type=positive_seconds, default=20.0, metavar="S", help="of virtual time (20)"
    )
    _add_file(parser)
    parser.set_defaults(run=run_virtual)


def _add_law(group: Commands) -> None:
    parser = add_command(
        group,
        "law",
        help="what a call of a compiled law takes",
        description="Calls a compiled PD law again and again from native code (needs Numba).",
        example="catenary bench law --axes 12",
    )
    parser.add_argument("--axes", type=positive_number, default=12, metavar="N")
    _add_file(parser)
    parser.set_defaults(run=run_law)


def _add_tasks(group: Commands) -> None:
    parser = add_command(
        group,
        "tasks",
        help="a task beside a busy one: processes and threads",
        description="Measures the response of a 1 kHz task of high priority: alone, beside a "
        "process that is busy at low priority, and beside a thread that is.",
        example="catenary bench tasks --seconds 10",
    )
    parser.add_argument(
        "--seconds", type=positive_seconds, default=10.0, metavar="S", help="of every way (10)"
    )
    _add_file(parser)
    parser.set_defaults(run=run_tasks)


def _add_soak(group: Commands) -> None:
    parser = add_command(
        group,
        "soak",
        help="random faults in virtual time, invariants checked in every cycle",
        description="Runs a loop on a segment in this process while faults of all kinds befall it, "
        "and judges by the virtual devices' own truth. The same seed gives the same run. Exit "
        "status 1 if anything happened that must not.",
        example="catenary bench soak --minutes 10 --seed 7 --json soak.json",
    )
    parser.add_argument(
        "--minutes", type=positive_seconds, default=1.0, metavar="N", help="of virtual time (1)"
    )
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="of chance (1)")
    _add_file(parser)
    parser.set_defaults(run=run_soak)


def _add_clocks(group: Commands) -> None:
    parser = add_command(
        group,
        "clocks",
        help="how soon distributed clocks come together, and how long they stay",
        description="Lets crystals differ, drift and scatter, in virtual time, and compares what "
        "each clock says with the reference. Exit status 1 where one was beyond 1 us.",
        example="catenary bench clocks --devices 10,33 --minutes 10",
    )
    parser.add_argument(
        "--devices",
        type=positive_numbers,
        default="10,33",
        metavar="N,M",
        help="segments of so many drives (10,33)",
    )
    parser.add_argument(
        "--minutes", type=positive_seconds, default=10.0, metavar="M", help="of virtual time (10)"
    )
    parser.add_argument(
        "--jitter",
        type=positive_seconds,
        default=0.5e-6,
        metavar="S",
        help="over which a time stamp scatters; a difference is made of two (0.5e-6)",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N")
    _add_file(parser)
    parser.set_defaults(run=run_clocks)


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
        help="(4000,8000)",
    )
    parser.add_argument(
        "--seconds", type=positive_seconds, default=10.0, metavar="S", help="of each (10)"
    )
    parser.add_argument("--rounds", type=positive_number, default=5, metavar="N", help="(5)")
    _add_file(parser)
    parser.set_defaults(run=run_networks)


def _add_igh(group: Commands) -> None:
    parser = add_command(
        group,
        "igh",
        help="a cycle over the IgH kernel master's library, beside C",
        description="Runs our step, the same calls hand-written in C and one ctypes call for each "
        "function on one activated master, in turns. All devices go to OP; drives stay disabled.",
        example="catenary bench igh --library libethercat-1.6.1.so.1 --json igh.json",
    )
    parser.add_argument(
        "--library", type=Path, metavar="FILE", help="another libethercat than the machine's"
    )
    _add_file(parser)
    parser.set_defaults(run=run_igh)


def _add_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")


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


def run_virtual(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.measure_virtual(
        drives=arguments.drives,
        seconds=arguments.seconds,
        file=arguments.json,
        config=arguments.config,
    )
    return 0


def run_tasks(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.measure_tasks(seconds=arguments.seconds, file=arguments.json)
    return 0


def run_law(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.measure_law(axes=arguments.axes, file=arguments.json)
    return 0


def run_soak(arguments: argparse.Namespace) -> int:
    from catenary import bench

    held = bench.measure_soak(minutes=arguments.minutes, seed=arguments.seed, file=arguments.json)
    return 0 if held else 1


def run_clocks(arguments: argparse.Namespace) -> int:
    from catenary import bench

    held = bench.measure_clocks(
        devices=arguments.devices,
        minutes=arguments.minutes,
        jitter=arguments.jitter,
        seed=arguments.seed,
        file=arguments.json,
    )
    return 0 if held else 1


def run_igh(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.measure_igh(library=arguments.library, file=arguments.json)
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

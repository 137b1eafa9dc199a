"""`python -m benchmarks`, what needs no wires: virtual time, tasks, laws, the kernel master's
library."""

from __future__ import annotations

import argparse
from pathlib import Path

from catenary.cli.arguments import (
    positive_minutes,
    positive_number,
    positive_numbers,
    positive_seconds,
)
from catenary.cli.bench_options import add_drives, add_file, add_seconds
from catenary.cli.parsers import Commands, add_command


def add_virtual(group: Commands) -> None:
    parser = add_command(
        group,
        "virtual",
        help="how much faster than real time a virtual segment runs",
        description="Runs a loop on a segment in this process, in virtual time.",
        example="python -m benchmarks virtual --drives 3 --seconds 20",
    )
    add_drives(parser)
    parser.add_argument(
        "--config", type=Path, metavar="FILE.toml", help="the drives of this segment, and its arm"
    )
    add_seconds(parser, 20.0, "of virtual time")
    add_file(parser)
    parser.set_defaults(run=run_virtual)


def add_law(group: Commands) -> None:
    parser = add_command(
        group,
        "law",
        help="what a call of a compiled law takes",
        description="Calls a compiled PD law again and again from native code (needs Numba).",
        example="python -m benchmarks law --axes 12",
    )
    parser.add_argument(
        "--axes", type=positive_number, default=12, metavar="N", help="of the law (12)"
    )
    add_file(parser)
    parser.set_defaults(run=run_law)


def add_tasks(group: Commands) -> None:
    parser = add_command(
        group,
        "tasks",
        help="a task beside a busy one: processes and threads",
        description="Measures the response of a 1 kHz task of high priority: alone, beside a "
        "process that is busy at low priority, and beside a thread that is.",
        example="python -m benchmarks tasks --seconds 10",
    )
    add_seconds(parser, 10.0, "of every way")
    add_file(parser)
    parser.set_defaults(run=run_tasks)


def add_soak(group: Commands) -> None:
    parser = add_command(
        group,
        "soak",
        help="random faults in virtual time, invariants checked in every cycle",
        description="Runs a loop on a virtual segment while random faults of all kinds happen, and "
        "checks the invariants by the virtual devices' own truth. The minutes take wiring, clocks "
        "and mode of operation in turn; the options select some of them. The same seed and options "
        "give the same run. A violation is printed with the command that repeats its minute. Exit "
        "status 1 on any violation.",
        example="python -m benchmarks soak --minutes 10 --seed 7 --wiring ring --json soak.json",
    )
    parser.add_argument(
        "--minutes", type=positive_minutes, default=1.0, metavar="N", help="of virtual time (1)"
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=1,
        metavar="S",
        help="of the first minute; minute k has S + k - 1 (1)",
    )
    parser.add_argument(
        "--wiring", choices=("line", "ring"), help="of the segment (line and ring in turn)"
    )
    parser.add_argument(
        "--clocks",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="drives with distributed clocks (with and without in turn)",
    )
    parser.add_argument(
        "--mode",
        choices=("csp", "csv", "cst"),
        help="mode of operation of the drives (all in turn)",
    )
    add_file(parser)
    parser.set_defaults(run=run_soak)


def add_clocks(group: Commands) -> None:
    parser = add_command(
        group,
        "clocks",
        help="how soon distributed clocks come together, and how long they stay",
        description="Lets crystals differ, drift and scatter, in virtual time, and compares what "
        "each clock says with the reference. Exit status 1 where one was beyond 1 us.",
        example="python -m benchmarks clocks --devices 10,33 --minutes 10",
    )
    parser.add_argument(
        "--devices",
        type=positive_numbers,
        default="10,33",
        metavar="N,M",
        help="segments of so many drives (10,33)",
    )
    parser.add_argument(
        "--minutes", type=positive_minutes, default=10.0, metavar="M", help="of virtual time (10)"
    )
    parser.add_argument(
        "--jitter",
        type=positive_seconds,
        default=0.5e-6,
        metavar="S",
        help="seconds over which a time stamp scatters; a difference is made of two (0.5e-6)",
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of chance (1)")
    add_file(parser)
    parser.set_defaults(run=run_clocks)


def add_igh(group: Commands) -> None:
    parser = add_command(
        group,
        "igh",
        help="a cycle over the IgH kernel master's library, beside C",
        description="Runs our step, the same calls hand-written in C and one ctypes call for each "
        "function on one activated master, in turns. All devices go to OP; drives stay disabled.",
        example="python -m benchmarks igh --library libethercat-1.6.1.so.1 --json igh.json",
    )
    parser.add_argument(
        "--library", type=Path, metavar="FILE", help="another libethercat than the machine's"
    )
    add_file(parser)
    parser.set_defaults(run=run_igh)


def run_virtual(arguments: argparse.Namespace) -> int:
    import benchmarks

    benchmarks.measure_virtual(
        drives=arguments.drives,
        seconds=arguments.seconds,
        file=arguments.json,
        config=arguments.config,
    )
    return 0


def run_tasks(arguments: argparse.Namespace) -> int:
    import benchmarks

    benchmarks.measure_tasks(seconds=arguments.seconds, file=arguments.json)
    return 0


def run_law(arguments: argparse.Namespace) -> int:
    import benchmarks

    benchmarks.measure_law(axes=arguments.axes, file=arguments.json)
    return 0


def run_soak(arguments: argparse.Namespace) -> int:
    import benchmarks

    held = benchmarks.measure_soak(
        minutes=arguments.minutes,
        seed=arguments.seed,
        wiring=arguments.wiring,
        clocks=arguments.clocks,
        mode=arguments.mode,
        file=arguments.json,
    )
    return 0 if held else 1


def run_clocks(arguments: argparse.Namespace) -> int:
    import benchmarks

    held = benchmarks.measure_clocks(
        devices=arguments.devices,
        minutes=arguments.minutes,
        jitter=arguments.jitter,
        seed=arguments.seed,
        file=arguments.json,
    )
    return 0 if held else 1


def run_igh(arguments: argparse.Namespace) -> int:
    import benchmarks

    benchmarks.measure_igh(library=arguments.library, file=arguments.json)
    return 0

"""Commands of `python -m benchmarks` that need no network interface."""

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
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command


def add_virtual(group: Commands) -> None:
    parser = add_command(
        group,
        "virtual",
        help="measure the speed of a virtual segment, relative to real time",
        description="Run a loop on a segment in this process, in virtual time.",
        example="python -m benchmarks virtual --drives 3 --seconds 20",
    )
    add_drives(parser)
    parser.add_argument(
        "--config",
        type=Path,
        metavar="FILE.toml",
        help="use the drives and the arm of this segment",
    )
    add_seconds(parser, 20.0, "virtual time")
    add_file(parser)
    parser.set_defaults(run=run_virtual)


def add_law(group: Commands) -> None:
    parser = add_command(
        group,
        "law",
        help="measure the time of a call of a compiled law",
        description="Call compiled laws repeatedly from native code (needs Numba).",
        example="python -m benchmarks law --axes 12",
    )
    parser.add_argument(
        "--axes",
        type=positive_number,
        default=12,
        metavar="N",
        help="axes of the law (default: 12)",
    )
    add_file(parser)
    parser.set_defaults(run=run_law)


def add_ros2(group: Commands) -> None:
    parser = add_command(
        group,
        "ros2",
        help="measure the time to publish a message to ROS 2",
        description="Publish JointState messages to a process that subscribes, without a ROS "
        "installation (needs cyclonedds).",
        example="python -m benchmarks ros2 --axes 7",
    )
    parser.add_argument(
        "--axes",
        type=positive_number,
        default=7,
        metavar="N",
        help="joints of the message (default: 7)",
    )
    add_file(parser)
    parser.set_defaults(run=run_ros2)


def add_tasks(group: Commands) -> None:
    parser = add_command(
        group,
        "tasks",
        help="measure a task next to a busy one, as processes and as threads",
        description="Measure the response of a 1 kHz task of high priority: alone, next to a busy "
        "low-priority process, and next to a busy low-priority thread.",
        example="python -m benchmarks tasks --seconds 10",
    )
    add_seconds(parser, 10.0, "run time of every variant")
    add_file(parser)
    parser.set_defaults(run=run_tasks)


def add_soak(group: Commands) -> None:
    parser = add_command(
        group,
        "soak",
        help="inject random faults in virtual time, and check invariants in every cycle",
        description="Run a loop on a virtual segment while random faults of all kinds occur, and "
        "check the invariants against the true state of the virtual devices. The minutes use all "
        "wirings, clocks and modes of operation in turn; the options select some of them. The same "
        "seed and options give the same run. A violation is printed with the command that repeats "
        "its minute. The exit status is 1 after any violation.",
        example="python -m benchmarks soak --minutes 10 --seed 7 --wiring ring --json soak.json\n"
        "python -m benchmarks soak --everything --minutes 60 --json everything.json\n"
        "python -m benchmarks soak --everything --wire --minutes 10",
    )
    parser.add_argument(
        "--minutes",
        type=positive_minutes,
        default=1.0,
        metavar="N",
        help="minutes of virtual time (default: 1)",
    )
    parser.add_argument(
        "--everything",
        action="store_true",
        help="run rings, clocks, objects, files, EoE, a share, a recorder, the dashboard and ROS 2 "
        "together instead; the memory and the descriptors of all processes must not grow",
    )
    parser.add_argument(
        "--wire",
        action="store_true",
        help="with --everything: network interfaces and real time, under load of the processors, "
        "the memory and the network",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=1,
        metavar="S",
        help="seed of the first minute; minute k uses S + k - 1 (default: 1)",
    )
    parser.add_argument(
        "--wiring",
        choices=("line", "ring"),
        help="wiring of the segment (default: line and ring in turn)",
    )
    parser.add_argument(
        "--clocks",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="use distributed clocks (default: with and without in turn)",
    )
    parser.add_argument(
        "--mode",
        choices=("csp", "csv", "cst"),
        help="mode of operation of the drives (default: all in turn)",
    )
    add_file(parser)
    parser.set_defaults(run=run_soak)


def add_clocks(group: Commands) -> None:
    parser = add_command(
        group,
        "clocks",
        help="measure the synchronisation of distributed clocks",
        description="Simulate crystals with deviation, drift and jitter in virtual time, and "
        "compare each clock with the reference. The exit status is 1 if a difference exceeds 1 us.",
        example="python -m benchmarks clocks --devices 10,33 --minutes 10",
    )
    parser.add_argument(
        "--devices",
        type=positive_numbers,
        default="10,33",
        metavar="N,M",
        help="numbers of drives, one segment each (default: 10,33)",
    )
    parser.add_argument(
        "--minutes",
        type=positive_minutes,
        default=10.0,
        metavar="M",
        help="minutes of virtual time (default: 10)",
    )
    parser.add_argument(
        "--jitter",
        type=positive_seconds,
        default=0.5e-6,
        metavar="S",
        help="jitter of a time stamp; a difference consists of two (default: 0.5e-6)",
    )
    parser.add_argument(
        "--seed", type=int, default=1, metavar="N", help="seed of the random numbers (default: 1)"
    )
    add_file(parser)
    parser.set_defaults(run=run_clocks)


def add_igh(group: Commands) -> None:
    parser = add_command(
        group,
        "igh",
        help="compare a cycle over the library of the IgH kernel master with C",
        description="Run our step, the same calls hand-written in C, and one ctypes call for each "
        "function, in turn on one activated master. All devices go to OP; drives stay disabled.",
        example="python -m benchmarks igh --library libethercat-1.6.1.so.1 --json igh.json",
    )
    parser.add_argument(
        "--library",
        type=Path,
        metavar="FILE",
        help="path of libethercat (default: the installed one)",
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


def run_ros2(arguments: argparse.Namespace) -> int:
    import benchmarks

    benchmarks.measure_ros2(axes=arguments.axes, file=arguments.json)
    return 0


def run_soak(arguments: argparse.Namespace) -> int:
    import benchmarks

    if arguments.wire and not arguments.everything:
        raise UsageError("--wire needs --everything")
    if arguments.everything:
        held = benchmarks.measure_everything(
            minutes=arguments.minutes,
            wire=arguments.wire,
            seed=arguments.seed,
            file=arguments.json,
        )
        return 0 if held else 1
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

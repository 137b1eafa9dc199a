"""`catenary bench`: measure the loop on this machine, or print a saved result."""

from __future__ import annotations

import argparse
from pathlib import Path

from catenary.cli.arguments import fifo_priority, number
from catenary.cli.bench_options import add_file, add_loop_options, add_seconds
from catenary.cli.doctor import period
from catenary.cli.failure import FAILED
from catenary.cli.parsers import Commands, add_command


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "bench",
        help="measure the loop on this machine",
        description="Measures the loop on this machine. To compare it with C, PySOEM and published "
        "figures, run `python -m benchmarks` in a clone of the repository "
        "(docs/explanation/benchmarks.md).",
        example="catenary bench loop --seconds 10 --json loop.json\n"
        "catenary bench latency --seconds 60\n"
        "catenary bench report loop.json",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_loop(group)
    _add_latency(group)
    _add_report(group)


def _add_loop(group: Commands) -> None:
    parser = add_command(
        group,
        "loop",
        help="measure the phases of the cyclic exchange",
        description="Runs catenary-inline, catenary-threaded and catenary-law (if Numba is "
        "installed) alternately in short rounds, on virtual devices in a private network. Prints "
        "the output delay, the input age and the CPU time per cycle, then the phases.",
        example="catenary bench loop --seconds 10 --json loop.json\n"
        "catenary bench loop --drives 33 --rate 4000 --body pd\n"
        "catenary bench loop --busy-wait 0.00005",
    )
    add_loop_options(parser)
    parser.set_defaults(run=run_loop)


def _add_latency(group: Commands) -> None:
    parser = add_command(
        group,
        "latency",
        help="measure the wake-up latency of threads",
        description="Wakes a thread periodically, like the latency check of `catenary doctor`, "
        "and judges the largest latency. Exit status 1 if the verdict is FAIL.",
        example="catenary bench latency --seconds 60 --json latency.json\n"
        "catenary bench latency --period 0.00025 --priority 90 --cpu 3",
    )
    add_seconds(parser, 10.0, "duration of the measurement")
    parser.add_argument(
        "--period", type=period, default=1e-3, metavar="S", help="wake-up period [s] (0.001)"
    )
    parser.add_argument(
        "--priority",
        type=fifo_priority,
        default=80,
        metavar="P",
        help="priority of the thread (80)",
    )
    parser.add_argument(
        "--cpu",
        type=number,
        metavar="N",
        help="CPU of the thread (default: the last isolated CPU, else the last CPU)",
    )
    add_file(parser)
    parser.set_defaults(run=run_latency)


def _add_report(group: Commands) -> None:
    parser = add_command(
        group,
        "report",
        help="print a saved result",
        description="Prints the figures and the verdict from a JSON file of `loop` or `latency`.",
        example="catenary bench report loop.json",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="a result file")
    parser.set_defaults(run=run_report)


def run_loop(arguments: argparse.Namespace) -> int:
    from catenary import bench

    bench.enter_private_network()
    from catenary.bench import loop  # imports NumPy
    from catenary.bench.setting import Setting

    setting = Setting(
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


def run_latency(arguments: argparse.Namespace) -> int:
    from catenary.bench import latency

    held = latency.measure(
        seconds=arguments.seconds,
        period=arguments.period,
        priority=arguments.priority,
        cpu=arguments.cpu,
        file=arguments.json,
    )
    return 0 if held else FAILED


def run_report(arguments: argparse.Namespace) -> int:
    from catenary.bench import saved

    print(saved.as_text(arguments.file))
    return 0

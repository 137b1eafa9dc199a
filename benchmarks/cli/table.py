"""`python -m benchmarks table`: published tables next to our figures."""

from __future__ import annotations

import argparse
import textwrap
from pathlib import Path

from catenary.cli.arguments import positive_number, positive_numbers, positive_seconds, seconds
from catenary.cli.bench_options import add_file
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command

EXAMPLE = """\
python -m benchmarks table pyigh --seconds 5
python -m benchmarks table tocabi --rates 4000 --peers law --json tocabi.json"""


def add_table(group: Commands) -> None:
    from benchmarks.tables import TABLES

    width = max(map(len, TABLES))
    lines = "\n".join(f"  {name:{width}}  {table.help}" for name, table in TABLES.items())
    parser = add_command(
        group,
        "table",
        help="print a published table and our figures",
        description="Print a published table next to our figures, both with their conditions. "
        "Parts that this machine cannot run (no compiler, PySOEM or permissions) are omitted and "
        f"named.\n\ntables:\n{lines}",
        example=textwrap.dedent(EXAMPLE),
    )
    parser.add_argument("name", metavar="NAME", help=f"one of {', '.join(TABLES)}")
    parser.add_argument(
        "--seconds",
        type=positive_seconds,
        metavar="S",
        help="run time of each column (default: that of the table)",
    )
    parser.add_argument(
        "--rounds",
        type=positive_number,
        metavar="N",
        help="rounds in which the programs take turns, each in a new process; the tests of pyigh "
        "need 8 (default for pyigh: 10)",
    )
    parser.add_argument(
        "--rates",
        type=positive_numbers,
        metavar="HZ,HZ",
        help="rates of the loops (default for tocabi: 4000,8000; humanoid_tasks: 4000; "
        "rteml: 5000; rdda: 2000)",
    )
    parser.add_argument(
        "--peers",
        metavar="A,B",
        help="peers of tocabi: loop, laws, law, triggered, c (default: all that can run here)",
    )
    parser.add_argument(
        "--axes",
        type=positive_numbers,
        metavar="N,N",
        help="tocabi: drives on each of its two networks (default: 18,15)",
    )
    parser.add_argument("--ring", action="store_true", help="use rings instead of lines")
    parser.add_argument(
        "--busy-wait",
        type=seconds,
        default=0.0,
        metavar="S",
        help="busy-wait of our loops before each cycle start (default: 0)",
    )
    parser.add_argument(
        "--example",
        type=Path,
        metavar="FILE",
        help="program of cobot (default: examples/cobot/cobot.py)",
    )
    parser.add_argument(
        "--realtime",
        action="store_true",
        help="run cobot on the machine's clock, not in virtual time",
    )
    parser.add_argument(
        "--stretch",
        type=positive_seconds,
        metavar="N",
        help="multiply the periods of cobot by N, for a slow processor",
    )
    parser.add_argument(
        "--short", action="store_true", help="run cobot only once, with gravity compensation"
    )
    add_file(parser)
    parser.set_defaults(run=run_table)


def run_table(arguments: argparse.Namespace) -> int:
    import benchmarks
    from benchmarks import tables

    try:
        tables.check(arguments.name)
    except ValueError as error:
        raise UsageError(str(error), hint="python -m benchmarks table --help") from None
    benchmarks.measure_table(
        arguments.name,
        seconds=arguments.seconds,
        rounds=arguments.rounds,
        rates=arguments.rates,
        peers=arguments.peers and [name for name in arguments.peers.split(",") if name],
        ring=arguments.ring,
        axes=arguments.axes,
        busy_wait=arguments.busy_wait,
        example=arguments.example,
        realtime=arguments.realtime,
        stretch=arguments.stretch,
        short=arguments.short,
        file=arguments.json,
    )
    return 0

"""Options that several benchmarks share."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import positive_number, positive_seconds, result_file, seconds


def add_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--json", type=result_file, metavar="FILE", help="write the figures to FILE"
    )


def add_drives(parser: argparse.ArgumentParser, default: int = 3) -> None:
    parser.add_argument(
        "--drives",
        type=positive_number,
        default=default,
        metavar="N",
        help=f"number of drives ({default})",
    )


def add_rate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--rate", type=positive_number, default=1000, metavar="HZ", help="rate of the loop (1000)"
    )


def add_seconds(parser: argparse.ArgumentParser, default: float, what: str) -> None:
    parser.add_argument(
        "--seconds",
        type=positive_seconds,
        default=default,
        metavar="S",
        help=f"{what} ({default:g})",
    )


def add_loop_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of the commands that measure the loop."""
    add_drives(parser)
    add_rate(parser)
    add_seconds(parser, 10.0, "duration for each variant")
    parser.add_argument(
        "--body", choices=("sine", "pd"), default="sine", help="computation in the loop body (sine)"
    )
    parser.add_argument(
        "--spin", action="store_true", help="run a busy Python thread next to every loop"
    )
    parser.add_argument(
        "--rounds",
        type=positive_number,
        metavar="N",
        help="rounds for each variant, each in a new process (default: rounds of 0.9 s at 1 kHz)",
    )
    parser.add_argument(
        "--busy-wait",
        type=seconds,
        default=0.0,
        metavar="S",
        help="duration of the busy-wait before each cycle start [s] (0)",
    )
    add_file(parser)

"""Options that benchmarks share."""

from __future__ import annotations

import argparse

from catenary.cli.arguments import positive_number, positive_seconds, result_file


def add_file(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", type=result_file, metavar="FILE", help="write the figures there")


def add_drives(parser: argparse.ArgumentParser, default: int = 3) -> None:
    parser.add_argument(
        "--drives", type=positive_number, default=default, metavar="N", help=f"so many ({default})"
    )


def add_rate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--rate", type=positive_number, default=1000, metavar="HZ", help="of the loop (1000)"
    )


def add_seconds(parser: argparse.ArgumentParser, default: float, what: str) -> None:
    parser.add_argument(
        "--seconds",
        type=positive_seconds,
        default=default,
        metavar="S",
        help=f"{what} ({default:g})",
    )

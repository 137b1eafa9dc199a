"""`catenary merge A.mcap B.mcap -o C.mcap`: merge recordings by time."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_json


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "merge",
        help="merge recordings by time",
        description="Merges recordings of several loops into one MCAP file, sorted by their UTC "
        "times. Each topic begins with the name of the share, or of the file if two names are "
        "equal. The clocks of several machines must be synchronised (`catenary doctor`), or the "
        "offset of a file must be known. Needs catenary[log].",
        example="catenary merge left.mcap right.mcap -o both.mcap\n"
        "catenary merge left.mcap right.mcap -o both.mcap --offset right.mcap=-0.0125",
    )
    parser.add_argument("files", metavar="FILE.mcap", nargs="+", help="recordings to merge")
    parser.add_argument(
        "-o", "--output", metavar="FILE.mcap", type=Path, required=True, help="file to write"
    )
    parser.add_argument(
        "--offset",
        metavar="FILE=S",
        type=file_offset,
        action="append",
        default=[],
        help="add S seconds to the times of a file; repeatable",
    )
    parser.add_argument("--force", action="store_true", help="replace an existing file")
    add_json(parser)
    parser.set_defaults(run=run)


def file_offset(text: str) -> tuple[str, float]:
    """Parse FILE=SECONDS."""
    file, _, number = text.rpartition("=")
    try:
        offset = float(number)
    except ValueError:
        offset = math.nan
    if not file or not math.isfinite(offset):
        raise argparse.ArgumentTypeError(f"{text!r}: must be FILE=SECONDS, such as arm.mcap=0.01")
    return file, offset


def run(arguments: argparse.Namespace) -> int:
    offsets = dict(arguments.offset)
    unknown = sorted(set(offsets) - set(arguments.files))
    if unknown:
        raise UsageError(
            f"--offset {unknown[0]}: not a file to merge",
            hint=f"use one of {', '.join(arguments.files)}",
        )
    from catenary.record import MergeInput, merge

    sources = [MergeInput(file, offsets.get(file, 0.0)) for file in arguments.files]
    merged = merge(sources, arguments.output, force=arguments.force)
    if arguments.json:
        result = {
            "file": str(arguments.output),
            "seconds": merged.seconds,
            "messages": merged.messages,
        }
        print(json.dumps(result, indent=2))
        return 0
    count = sum(merged.messages.values())
    print(f"{arguments.output}: {count} messages, {merged.seconds:.3f} s")
    for topic, number in sorted(merged.messages.items()):
        print(f"  {topic}: {number}")
    return 0

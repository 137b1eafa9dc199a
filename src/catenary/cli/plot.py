"""`catenary plot FILE`: draw a recording or a log."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import seconds
from catenary.cli.failure import UsageError
from catenary.cli.parsers import Commands, add_command, add_json

if TYPE_CHECKING:
    from catenary.record import Recording

KINDS = (".png", ".html", ".svg", ".pdf")


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "plot",
        help="draw a recording or a log as a picture or an HTML page",
        description="Draws a recording (.mcap) or a log that to_csv wrote (.csv). It shows "
        "position, reference, tracking error and torque of every axis, histograms of the timing, "
        "and events as dashed lines. An HTML page also lists the figures of every axis and the "
        "events. Needs catenary[log].",
        example="catenary plot arm.mcap\n"
        "catenary plot arm.mcap -o arm.html --degrees\n"
        "catenary plot run.csv\n"
        "catenary plot arm.mcap -o stop.png --axis elbow --start 12.5 --end 13\n"
        "catenary plot both.mcap --share left",
    )
    parser.add_argument("file", metavar="FILE", help="the recording (.mcap), or a log (.csv)")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        type=Path,
        help=f"picture to write: {', '.join(KINDS)} (FILE.png)",
    )
    add_choice(parser)
    parser.add_argument(
        "--reference",
        metavar="FIELD",
        help="field of the reference, such as target_position (default in CSP: commanded_position)",
    )
    parser.add_argument(
        "--degrees", action="store_true", help="show angles in degrees instead of radians"
    )
    add_json(parser)
    parser.set_defaults(run=run)


def add_choice(parser: argparse.ArgumentParser) -> None:
    """Add the options that choose a part of the recording."""
    parser.add_argument(
        "--share", metavar="NAME", help="share to draw, in a file that `catenary merge` wrote"
    )
    parser.add_argument(
        "--axis", metavar="NAME", action="append", help="draw only this axis; repeatable"
    )
    parser.add_argument("--start", metavar="S", type=seconds, default=0.0, help="start at second S")
    parser.add_argument(
        "--end", metavar="S", type=seconds, default=math.inf, help="end at second S"
    )


def run(arguments: argparse.Namespace) -> int:
    output = arguments.output or Path(arguments.file).with_suffix(".png")
    if output.suffix.lower() not in KINDS:
        raise UsageError(
            f"{output}: the name must end in {', '.join(KINDS)}", hint="for example: -o plot.png"
        )
    from catenary.record import plot

    recording = read_file(arguments)
    if not len(recording):
        raise UsageError(
            f"{arguments.file} has no cycles in this time range", hint="change --start or --end"
        )
    plot(
        recording,
        output,
        axes=arguments.axis,
        reference=arguments.reference,
        unit="deg" if arguments.degrees else "rad",
    )
    if arguments.json:
        found = {"file": str(output), "cycles": len(recording), "loop": recording.name}
        print(json.dumps(found | {"axes": list(recording.axes)}, indent=2))
    else:
        print(f"{output}: {len(recording)} cycles of {recording.name}, {len(recording.axes)} axes")
    return 0


def read_file(arguments: argparse.Namespace) -> Recording:
    """Read the requested part of the recording or of the log."""
    from catenary.record import read, read_csv

    file, start, end = arguments.file, arguments.start, arguments.end
    if Path(file).suffix.lower() != ".csv":
        return read(file, start=start, end=end, share=arguments.share)
    if arguments.share is not None:
        raise UsageError("--share: a log in CSV has only one loop", hint="omit --share")
    return read_csv(file, start=start, end=end)

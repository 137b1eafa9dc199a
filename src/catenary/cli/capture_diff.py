"""`catenary capture diff`: what two masters did differently until OP."""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING, TextIO

from catenary.cli.failure import report
from catenary.cli.parsers import Commands, add_command, add_json
from catenary.errors import DecodeError

if TYPE_CHECKING:
    from catenary.capture import Timeline

EQUAL, DIFFERENT, UNREADABLE = 0, 1, 2


def add_to(group: Commands) -> None:
    parser = add_command(
        group,
        "diff",
        help="compare the bring-ups in two captures",
        description="Compares what two masters did with the same devices until OP: SDO writes, "
        "SyncManagers, FMMUs, clocks, watchdogs and states. Names the difference to look at "
        "first. Devices are paired by vendor, product and serial number, then by order. Times and "
        "addresses are not compared. Exit status 0 if the captures are equal, 1 if they differ, 2 "
        "if one cannot be read.",
        example="catenary capture diff twincat.pcapng ours.pcapng",
    )
    parser.add_argument("a", metavar="A", help="pcapng or pcap file, such as the one that works")
    parser.add_argument("b", metavar="B", help="pcapng or pcap file to compare with A")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the differences. Return 0, 1 or 2; see the help."""
    from catenary.capture.diff import compare

    timelines = [read(name) for name in (arguments.a, arguments.b)]
    a, b = timelines
    if a is None or b is None:
        return UNREADABLE
    comparison = compare(a, b)
    if arguments.json:
        from catenary.cli.capture_diff_json import as_object

        print(json.dumps(as_object(comparison, arguments.a, arguments.b), indent=2))
    else:
        from catenary.cli.capture_diff_text import print_comparison

        print_comparison(comparison, arguments.a, arguments.b)
    for name, timeline in (("A", a), ("B", b)):
        print_notes(name, timeline, sys.stderr if arguments.json else sys.stdout)
    return EQUAL if comparison.equal else DIFFERENT


def read(name: str) -> Timeline | None:
    """Return the timeline of a capture; None after an error message."""
    from catenary.capture import read_timeline

    try:
        timeline = read_timeline(name)
    except DecodeError as error:
        report(DecodeError(f"{name}: {error.message}", hint=error.hint))
        return None
    except OSError as error:
        report(error)
        return None
    if not timeline.counts.ethercat:
        print(f"catenary: {name}: no EtherCAT frame", file=sys.stderr)
        print(
            "  hint: capture on the interface of the master, with the EtherType 0x88A4",
            file=sys.stderr,
        )
        return None
    return timeline


def print_notes(name: str, timeline: Timeline, file: TextIO) -> None:
    """Print the remarks on a capture.

    Args:
        name: "A", "B" or the name of the file.
        timeline: The capture.
        file: Stream to print to.
    """
    from catenary.capture.notes import notes
    from catenary.cli.text import escaped

    for note in notes(timeline.counts, timeline.masters):
        print(f"note on {escaped(name)}: {escaped(note)}", file=file)
    if not timeline.complete:
        first = f"only the first {len(timeline.events)} events were used"
        print(f"note on {escaped(name)}: {first}", file=file)

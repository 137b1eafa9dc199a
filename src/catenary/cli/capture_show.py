"""`catenary capture show`: what a master did with its devices, as a timeline."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, BinaryIO

from catenary.cli.arguments import position, seconds
from catenary.cli.failure import UsageError, report
from catenary.cli.parsers import Commands, add_command, add_json
from catenary.errors import DecodeError

if TYPE_CHECKING:
    from catenary.capture import Event, EventStream

UNREADABLE = 2
EXAMPLE = """\
catenary capture show twincat.pcapng
catenary capture show twincat.pcapng --device 1 --from 0.5 --to 2
catenary capture show run.pcapng --json"""


def add_to(group: Commands) -> None:
    parser = add_command(
        group,
        "show",
        help="show the bring-up in a capture as a timeline",
        description="Shows states, registers, SDO transfers, other mailbox messages, working "
        "counters, clocks and lost frames, and statistics at the end. Reads files of any size. "
        "Exit status 1 if the file contains no EtherCAT frame or is damaged, 2 if it cannot be "
        "read.",
        example=EXAMPLE,
    )
    parser.add_argument("file", metavar="FILE", help="pcapng or pcap file; - reads stdin")
    parser.add_argument(
        "--device",
        metavar="N",
        type=position,
        help="only the device at position N, or with station address N",
    )
    parser.add_argument(
        "--from", dest="start", metavar="S", type=seconds, help="first time [s] to show"
    )
    parser.add_argument("--to", dest="end", metavar="S", type=seconds, help="last time [s] to show")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the timeline. Return 0, 1 or 2; see the help."""
    from catenary.capture import EventStream

    until = None if arguments.end is None else round(arguments.end * 1e9)
    if arguments.end is not None and arguments.end < (arguments.start or 0.0):
        raise UsageError("--to must not be before --from")
    try:
        with open_capture(arguments.file) as file:
            stream = EventStream(file.read, until_ns=until)
            return _show(stream, arguments)
    except BrokenPipeError:
        raise
    except DecodeError as error:
        report(DecodeError(f"{arguments.file}: {error.message}", hint=error.hint))
        return UNREADABLE
    except OSError as error:
        report(error)
        return UNREADABLE


def open_capture(name: str) -> BinaryIO:
    """Open a capture file. The name - is stdin."""
    return sys.stdin.buffer if name == "-" else open(name, "rb")


def _show(stream: EventStream, arguments: argparse.Namespace) -> int:
    from catenary.cli.capture_json import event_object, summary_object
    from catenary.cli.capture_text import print_rows, print_summary

    events = _chosen(stream, arguments)
    if arguments.json:
        for event in events:
            print(json.dumps(event_object(event, stream.device(event))))
        print(json.dumps(summary_object(stream)))
    else:
        print_rows(stream, events)
        print_summary(stream)
    return _status(stream, arguments)


def _chosen(stream: EventStream, arguments: argparse.Namespace) -> Iterator[Event]:
    """Yield the events that the arguments select."""
    start = round((arguments.start or 0.0) * 1e9)
    for event in stream:
        if event.time_ns >= start and _concerns(stream, event, arguments.device):
            yield event


def _concerns(stream: EventStream, event: Event, wanted: int | None) -> bool:
    """Return True if an event belongs to the chosen device, or is a state of all devices."""
    if wanted is None:
        return True
    device = stream.device(event)
    if device is None:
        return event.content.kind in ("state-request", "state")
    return wanted in (device.position, device.station)


def _status(stream: EventStream, arguments: argparse.Namespace) -> int:
    if not stream.counts.ethercat:
        print(f"catenary: {arguments.file}: no EtherCAT frame", file=sys.stderr)
        print(
            "  hint: capture on the interface of the master, with the EtherType 0x88A4",
            file=sys.stderr,
        )
        return 1
    devices = [device for each in stream.masters for device in each.devices]
    wanted = arguments.device
    if wanted is not None and not any(wanted in (d.position, d.station) for d in devices):
        known = ", ".join(map(str, devices)) or "none"
        print(f"catenary: {arguments.file}: no device {wanted}; devices: {known}", file=sys.stderr)
        return 1
    return 1 if stream.counts.damaged else 0

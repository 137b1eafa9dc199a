"""`catenary diag TARGET`: find the cable or device at fault."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from catenary.cli import share_target
from catenary.cli.arguments import positive_seconds
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_target,
    note_other_masters,
)

if TYPE_CHECKING:
    from catenary.bus.diagnosis import Diagnosis
    from catenary.wire.error_counters import ErrorCounters

SINCE_POWER_UP = "since the devices' power-up, or the last --clear"


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "diag",
        help="find the cable or device at fault",
        description="Reads the error counters of all devices and reports the cable, device or "
        f"power supply at fault. The counters contain errors {SINCE_POWER_UP}, including errors at "
        "power-up. With --seconds, sends frames to provoke errors, and reports only new errors. "
        "Exit status 1 if there is a fault.",
        example="catenary diag eth0\ncatenary diag eth0 --seconds 10\ncatenary diag eth0 --clear",
    )
    add_target(parser)
    parser.add_argument(
        "--seconds",
        metavar="N",
        type=positive_seconds,
        help="measure for N seconds and report only new errors",
    )
    parser.add_argument("--clear", action="store_true", help="set all counters to zero afterwards")
    add_force(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.procedure.cable_traffic import exercise
    from catenary.procedure.error_counters import clear_error_counters
    from catenary.target import MainDevice

    if share_target.names_share(arguments.target):
        return share_target.diag(arguments)
    sent = 0
    reads = not arguments.clear
    with MainDevice(arguments.target, force=reads or arguments.force) as main:
        if reads:
            note_other_masters(main)
        subs = main.passive_scan()
        found = main.diagnose(subs=subs)
        if arguments.seconds is not None:
            sent, lost = main.converse(exercise(arguments.seconds))
            found = main.diagnose(subs=subs, since=found, lost_frames=lost)
        if arguments.clear:
            main.converse(clear_error_counters([sub.station for sub in subs]))
    print(as_json(found, arguments.seconds) if arguments.json else as_text(found, sent, arguments))
    return int(bool(found))


def as_text(found: Diagnosis, sent: int, arguments: argparse.Namespace) -> str:
    from catenary.cli.tables import table

    span = SINCE_POWER_UP
    if arguments.seconds is not None:
        span = f"within {arguments.seconds:g} s ({sent} frames sent)"
    if not found:
        return f"no fault found: {len(found.topology)} devices counted no error {span}"
    lines = [f"number of faults: {len(found.findings)}, {span}", *map(str, found.findings)]
    rows = counter_rows(found)
    return "\n".join([*lines, "", table([HEADINGS, *rows])] if rows else lines)


HEADINGS = ("pos", "port", "broken frames", "symbol errors", "forwarded", "lost links", "cable to")


def counter_rows(found: Diagnosis) -> list[tuple[str, ...]]:
    """Return a row for each port with a counter that is not zero."""
    rows = []
    for position, errors in enumerate(found.counters):
        for port, count in enumerate(errors.ports if errors else ()):
            if not count:
                continue
            numbers = (count.invalid_frames, count.symbol_errors, count.forwarded, count.lost_links)
            rows.append(
                (str(position), str(port), *map(str, numbers), _opposite(found, position, port))
            )
    return rows


def _opposite(found: Diagnosis, position: int, port: int) -> str:
    cable = found.topology.cable_at(position, port)
    if cable is None:
        return ""
    other = cable[:2] if cable[2:] == (position, port) else cable[2:]
    return found.names.end(*other)


def as_json(found: Diagnosis, seconds: float | None) -> str:
    return json.dumps(
        {
            "seconds": seconds,
            "findings": [
                {
                    "kind": each.kind,
                    "where": each.where,
                    "evidence": each.evidence,
                    "advice": each.advice,
                    "devices": each.devices,
                }
                for each in found.findings
            ],
            "devices": [
                {
                    "position": position,
                    "name": found.names.names[position],
                    "answers": errors is not None,
                    **(counters(errors) if errors is not None else {}),
                }
                for position, errors in enumerate(found.counters)
            ],
        },
        indent=2,
    )


def counters(errors: ErrorCounters) -> dict[str, object]:
    """Return all counters of one device for JSON."""
    return {
        "ports": [
            {
                "invalid_frames": port.invalid_frames,
                "symbol_errors": port.symbol_errors,
                "forwarded": port.forwarded,
                "lost_links": port.lost_links,
            }
            for port in errors.ports
        ],
        "processing_unit": errors.processing_unit,
        "pdi": errors.pdi,
    }

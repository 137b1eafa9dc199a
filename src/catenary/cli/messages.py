"""`catenary messages TARGET [POSITION]`: show the diagnosis messages that devices have stored."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from catenary.cli import share_target
from catenary.cli.failure import UsageError
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_optional_position,
    add_target,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from catenary.bus import SubDevice
    from catenary.errors import CatenaryError
    from catenary.model.diagnosis_history import HistoryMessage, SyncCounters
    from catenary.remote import Client
    from catenary.remote.messages import Device


NAMES = ("index", "missed", "exceeded", "shift_too_short", "error")  # of SyncCounters


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "messages",
        help="show the diagnosis messages that devices have stored",
        description="Brings all devices to PRE-OP and shows the messages of their diagnosis "
        "history (object 0x10F3), oldest first, and their counters of synchronisation errors "
        "(0x1C32, 0x1C33) that are not zero. Texts come from the ESI files of the devices. The "
        "messages of a running loop are read through its share, without texts. Exit status 1 if "
        "there is an error that is not acknowledged, or a device fails.",
        example="catenary messages eth0\ncatenary messages eth0 2 --json\n"
        "catenary messages eth0 2 --acknowledge\ncatenary messages share:arm",
    )
    add_target(parser)
    add_optional_position(parser)
    action = parser.add_mutually_exclusive_group()
    action.add_argument(
        "--acknowledge", action="store_true", help="acknowledge the messages that were read"
    )
    action.add_argument(
        "--clear",
        action="store_true",
        help="delete the messages after reading; in the acknowledge mode only acknowledged ones",
    )
    add_force(parser)
    add_json(parser)
    parser.set_defaults(run=run)


@dataclass(frozen=True, slots=True)
class Report:
    """Messages and counters of one device. `history`: None if they were not read."""

    position: int
    name: str
    history: Sequence[HistoryMessage] | None = None
    counters: Sequence[SyncCounters] = ()
    error: CatenaryError | None = None

    @property
    def is_bad(self) -> bool:
        """True if the device has failed, or has an error that is not acknowledged."""
        faults = (not m.acknowledged and m.severity == "error" for m in self.history or ())
        return self.error is not None or any(faults)


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.failure import with_hint

    of_share = share_target.names_share(arguments.target)
    reports = share_reports(arguments) if of_share else reports_of(arguments)
    if arguments.json:
        print(json.dumps([as_values(each) for each in reports], indent=2))
    else:
        print(as_text(reports))
    for each in reports:
        if each.error is not None:
            print(f"error: {with_hint(each.error)}", file=sys.stderr)
    return int(any(each.is_bad for each in reports))


def reports_of(arguments: argparse.Namespace) -> list[Report]:
    """Read the devices of a target: one device, or all that have an object dictionary."""
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    with MainDevice(arguments.target, force=arguments.force) as main:
        devices: Sequence[SubDevice] = main.scan(strict=False)
        if arguments.position is not None:
            chosen: Sequence[SubDevice] = [device_at(devices, arguments.position)]
        else:
            chosen = [each for each in devices if each.description.coe or each.error is not None]
        return [read_device(each, arguments) for each in chosen]


def read_device(device: SubDevice, arguments: argparse.Namespace) -> Report:
    """Read a device, and acknowledge or delete its messages on request."""
    from catenary.errors import CatenaryError

    report = Report(device.position, device.name, error=device.error)
    if device.error is not None or not device.description.coe:
        return report
    try:
        report = replace(report, history=messages_of(device))
        if report.history and arguments.acknowledge:
            device.diagnosis.acknowledge(report.history[-1])
        elif report.history and arguments.clear:
            device.diagnosis.clear()
        return replace(report, counters=device.diagnosis.synchronisation())
    except CatenaryError as error:  # other devices may have messages
        return replace(report, error=error)


def messages_of(device: SubDevice) -> Sequence[HistoryMessage] | None:
    """Read the messages of a device; None if it refuses object 0x10F3."""
    from catenary.errors import MailboxError, SdoAbort

    try:
        return device.diagnosis.messages()
    except MailboxError as error:
        if isinstance(error.__cause__, SdoAbort):
            return None
        raise


def share_reports(arguments: argparse.Namespace) -> list[Report]:
    """Read the devices of the program that owns a share."""
    if arguments.acknowledge or arguments.clear:
        raise UsageError(
            "messages of a running program are only read",
            hint="acknowledge them in the program: sub.diagnosis.acknowledge()",
        )
    with share_target.connect_to(arguments.target) as program:
        devices = program.devices()
        position = share_target.position_in(program, arguments.position)
        if position is None:
            chosen = [each for each in devices if each.coe]
        else:
            chosen = [each for each in devices if each.position == position]
            if not chosen:
                raise UsageError(
                    f"there is no device {position}; the program has {len(devices)} devices"
                )
        return [read_share_device(program, each) for each in chosen]


def read_share_device(program: Client, device: Device) -> Report:
    """Read a device of the program that owns a share."""
    from catenary.cli.share_messages import read_device as read
    from catenary.errors import CatenaryError

    report = Report(device.position, device.name)
    try:
        history, counters = read(program, device.position) if device.coe else (None, ())
    except CatenaryError as error:
        return replace(report, error=error)
    return replace(report, history=history, counters=counters)


def as_text(reports: Iterable[Report]) -> str:
    from catenary.cli.text import escaped

    lines: list[str] = []
    for report in reports:
        messages = report.history
        lines.append(escaped(f"{report.position} {report.name}: {_number(report)}"))
        for each in messages or ():
            mark = "  (acknowledged)" if each.acknowledged else ""
            lines.append(escaped(f"  {each}{mark}"))
        lines += [f"  {text}" for each in report.counters for text in counter_lines(each)]
    return "\n".join(lines) or "no device has an object dictionary"


def _number(report: Report) -> str:
    """Return the number of messages as text."""
    if report.history is None:
        return "no diagnosis history" if report.error is None else "failed"
    count = len(report.history)
    return "1 message" if count == 1 else f"{count} messages"


def counter_lines(counters: SyncCounters) -> Iterable[str]:
    """Yield a line for each counter that is not zero."""
    for counter, number in counters.by_counter.items():
        if number:
            place = f"0x{counters.index:04X}:{counter:02X}"
            yield f"{counters.direction}: {counter.text} ({place} = {number})"


def as_values(report: Report) -> dict[str, object]:
    """Return the report for JSON."""
    from catenary.cli.plain import plain

    return {
        "position": report.position,
        "name": report.name,
        "messages": None if report.history is None else plain(tuple(report.history)),
        "synchronisation": [
            {"direction": each.direction, **{name: getattr(each, name) for name in NAMES}}
            for each in report.counters
        ],
        "error": None if report.error is None else str(report.error),
    }

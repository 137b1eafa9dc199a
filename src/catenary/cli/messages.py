"""`catenary messages TARGET [POSITION]`: show the diagnosis messages that devices have stored."""

from __future__ import annotations

import argparse
import json
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
    from catenary.model.diagnosis_history import HistoryMessage, SyncCounters


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "messages",
        help="show the diagnosis messages that devices have stored",
        description="Brings all devices to PRE-OP and shows the messages of their diagnosis "
        "history (object 0x10F3), oldest first, and their counters of synchronisation errors "
        "(0x1C32, 0x1C33) that are not zero. Texts come from the ESI files of the devices. The "
        "messages of a running loop are read through its share. Exit status 1 if there is an "
        "error that is not acknowledged.",
        example="catenary messages eth0\ncatenary messages eth0 2 --json\n"
        "catenary messages eth0 2 --acknowledge\ncatenary messages share:arm",
    )
    add_target(parser)
    add_optional_position(parser)
    action = parser.add_mutually_exclusive_group()
    action.add_argument(
        "--acknowledge", action="store_true", help="acknowledge the messages after reading"
    )
    action.add_argument(
        "--clear",
        action="store_true",
        help="delete the messages after reading; in the acknowledge mode only acknowledged ones",
    )
    add_force(parser)
    add_json(parser)
    parser.set_defaults(run=run)


class Report:
    """Messages and counters of one device. `history`: None without object 0x10F3."""

    def __init__(
        self,
        position: int,
        name: str,
        history: Sequence[HistoryMessage] | None,
        counters: Sequence[SyncCounters],
    ) -> None:
        self.position = position
        self.name = name
        self.history = history
        self.counters = counters

    @property
    def faults(self) -> int:
        """Number of errors that are not acknowledged."""
        return sum(not m.acknowledged and m.severity == "error" for m in self.history or ())


def run(arguments: argparse.Namespace) -> int:
    if share_target.names_share(arguments.target):
        reports = of_share(arguments)
        failed = 0
    else:
        reports, failed = of_devices(arguments)
    if arguments.json:
        print(json.dumps([as_values(each) for each in reports], indent=2))
    else:
        print(as_text(reports))
    return int(failed or any(each.faults for each in reports))


def of_devices(arguments: argparse.Namespace) -> tuple[list[Report], int]:
    """Read the devices of a target. Return the reports, and 1 if a device has failed."""
    from catenary.cli.devices import device_at, report_failures
    from catenary.target import MainDevice

    with MainDevice(arguments.target, force=arguments.force) as main:
        devices: Sequence[SubDevice] = main.scan(strict=False)
        if arguments.position is not None:
            devices = [device_at(devices, arguments.position)]
        working = [each for each in devices if each.error is None]
        reports = [read_device(each) for each in working if has_objects(each)]
        for device, report in zip(filter(has_objects, working), reports, strict=True):
            if report.history and (arguments.acknowledge or arguments.clear):
                act = device.diagnosis.clear if arguments.clear else device.diagnosis.acknowledge
                act()
    return reports, report_failures(devices)


def has_objects(device: SubDevice) -> bool:
    return device.description.coe


def read_device(device: SubDevice) -> Report:
    from catenary.errors import MailboxError, SdoAbort

    history: Sequence[HistoryMessage] | None
    try:
        history = device.diagnosis.messages()
    except MailboxError as error:
        if not isinstance(error.__cause__, SdoAbort):
            raise
        history = None  # the device refuses object 0x10F3
    return Report(device.position, device.name, history, device.diagnosis.synchronisation())


def of_share(arguments: argparse.Namespace) -> list[Report]:
    """Read the devices of the program that owns a share."""
    if arguments.acknowledge or arguments.clear:
        raise UsageError(
            "messages of a running program are only read",
            hint="acknowledge them in the program: sub.diagnosis.acknowledge()",
        )
    from catenary.cli.share_messages import read_device as read

    with share_target.connect_to(arguments.target) as program:
        devices = program.devices()
        position = share_target.position_in(program, arguments.position)
        chosen = [each for each in devices if position in (None, each.position)]
        if not chosen:
            raise UsageError(
                f"there is no device {position}; the program has {len(devices)} devices"
            )
        found = ((each, read(program, each.position)) for each in chosen)
        return [
            Report(each.position, each.name, *contents)
            for each, contents in found
            if contents is not None
        ]


def as_text(reports: Iterable[Report]) -> str:
    from catenary.cli.text import escaped

    lines: list[str] = []
    for report in reports:
        messages = report.history
        number = "no diagnosis history" if messages is None else f"{len(messages)} messages"
        lines.append(escaped(f"{report.position} {report.name}: {number}"))
        for each in messages or ():
            mark = "  (acknowledged)" if each.acknowledged else ""
            lines.append(escaped(f"  {each}{mark}"))
        lines += [f"  {text}" for each in report.counters for text in counter_lines(each)]
    return "\n".join(lines) or "no device has an object dictionary"


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
            {"direction": each.direction, **_fields(plain(each))} for each in report.counters
        ],
    }


def _fields(value: object) -> dict[str, object]:
    assert isinstance(value, dict)
    return value

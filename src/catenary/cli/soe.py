"""`catenary soe read|write|list|info|command`: access the IDNs of a SERCOS drive (SoE)."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from catenary.cli.arguments import positive_seconds
from catenary.cli.failure import UsageError, one_line
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_position,
    add_target,
)
from catenary.cli.share_target import require_interface
from catenary.cli.soe_values import facts, line, parsed, shown
from catenary.cli.text import escaped

if TYPE_CHECKING:
    from catenary.bus import SubDevice

DRIVES = 8


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "soe",
        help="read, write or run the IDNs of a SERCOS drive",
        description="Reads, writes, describes or runs the parameters (IDNs) of a SERCOS drive "
        "(Servo drive profile over EtherCAT), or lists them.",
        example="catenary soe read eth0 2 S-0-0051\n"
        "catenary soe write eth0 2 S-0-0032 11\n"
        "catenary soe command eth0 2 S-0-0099",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_read(group)
    _add_write(group)
    _add_info(group)
    _add_list(group)
    _add_command(group)


def _add_read(group: Commands) -> None:
    reading = add_command(
        group,
        "read",
        help="read the value of an IDN",
        description="Reads the value of an IDN. Numbers have the decimals of its attribute.",
        example="catenary soe read eth0 2 S-0-0051\n"
        "catenary soe read eth0 2 S-0-0095 --drive 1 --json",
    )
    _add_idn(reading)
    reading.set_defaults(run=run_read)


def _add_write(group: Commands) -> None:
    writing = add_command(
        group,
        "write",
        help="write the value of an IDN",
        description="Writes the value of an IDN. Its attribute determines the format of VALUE: a "
        "number, a text, an IDN, or a list of these with commas.",
        example="catenary soe write eth0 2 S-0-0092 150.5\n"
        "catenary soe write eth0 2 S-0-0024 S-0-0047,S-0-0036",
    )
    _add_idn(writing)
    writing.add_argument(
        "value", metavar="VALUE", help="number, text, IDN, or a list of these: 1,2,3"
    )
    writing.set_defaults(run=run_write)


def _add_info(group: Commands) -> None:
    showing = add_command(
        group,
        "info",
        help="show all elements of an IDN",
        description="Shows name, value, unit, limits, default value and attribute of an IDN.",
        example="catenary soe info eth0 2 S-0-0047",
    )
    _add_idn(showing)
    showing.set_defaults(run=run_info)


def _add_list(group: Commands) -> None:
    listing = add_command(
        group,
        "list",
        help="list all IDNs",
        description="Lists the IDNs of a drive (S-0-0017). With --values, reads all their "
        "elements, too.",
        example="catenary soe list eth0 2\ncatenary soe list eth0 2 --values --json",
    )
    _add_drive(listing)
    listing.add_argument("--values", action="store_true", help="also read names and values")
    listing.set_defaults(run=run_list)


def _add_command(group: Commands) -> None:
    running = add_command(
        group,
        "command",
        help="run a procedure command",
        description="Starts a procedure command, waits for its end, and clears it. A command that "
        "does not end in time is cancelled.",
        example="catenary soe command eth0 2 S-0-0099",
    )
    _add_idn(running)
    running.add_argument(
        "--timeout",
        metavar="SECONDS",
        type=positive_seconds,
        default=10.0,
        help="longest time until the command ends (default: 10)",
    )
    running.set_defaults(run=run_command)


def _add_drive(parser: argparse.ArgumentParser) -> None:
    add_target(parser)
    add_position(parser)
    parser.add_argument(
        "--drive",
        metavar="N",
        type=int,
        choices=range(DRIVES),
        default=0,
        help="number of the drive in the device, 0 to 7 (default: 0)",
    )
    add_force(parser)
    add_json(parser)


def _add_idn(parser: argparse.ArgumentParser) -> None:
    _add_drive(parser)
    parser.add_argument("idn", metavar="IDN", help="parameter, such as S-0-0047 or P-0-0010")


@contextmanager
def _device(arguments: argparse.Namespace) -> Iterator[SubDevice]:
    """Scan the segment, and yield the device."""
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    require_interface(arguments.target, "IDNs")
    with MainDevice(arguments.target, force=arguments.force) as main:
        yield device_at(main.scan(strict=False), arguments.position)


def _idn(arguments: argparse.Namespace) -> str:
    """Return the notation of the IDN. Raises UsageError if it is not valid."""
    from catenary.wire.sercos import idn_number, idn_text

    try:
        return idn_text(idn_number(arguments.idn))
    except ValueError as error:
        raise UsageError(str(error)) from error


def run_read(arguments: argparse.Namespace) -> int:
    idn = _idn(arguments)
    with _device(arguments) as device:
        value = device.soe.read(idn, drive=arguments.drive)
    if arguments.json:
        print(json.dumps({"idn": idn, "drive": arguments.drive, "value": value}))
    else:
        print(shown(value))
    return 0


def run_write(arguments: argparse.Namespace) -> int:
    from catenary.wire.sercos import decode_attribute
    from catenary.wire.soe import Element

    idn = _idn(arguments)
    with _device(arguments) as device:
        data = device.soe.read_bytes(idn, Element.ATTRIBUTE, drive=arguments.drive)
        value = parsed(arguments.value, decode_attribute(data))
        try:
            device.soe.write(idn, value, drive=arguments.drive)
        except (ValueError, TypeError) as error:
            raise UsageError(str(error)) from error
    if arguments.json:
        print(json.dumps({"idn": idn, "drive": arguments.drive, "value": value}))
    else:
        print(f"{escaped(str(device.station))}: {idn} = {shown(value)}")
    return 0


def run_info(arguments: argparse.Namespace) -> int:
    idn = _idn(arguments)
    with _device(arguments) as device:
        found = device.soe.describe(idn, drive=arguments.drive)
    if arguments.json:
        print(json.dumps(facts(found)))
        return 0
    for name, fact in facts(found).items():
        if fact is not False and fact not in (None, "", []):  # 0 == False
            print(f"{name:14} {shown(fact) if isinstance(fact, (list, str)) else fact}")
    return 0


def run_list(arguments: argparse.Namespace) -> int:
    from catenary.errors import MailboxError, SoeError

    with _device(arguments) as device:
        idns = device.soe.list(drive=arguments.drive)
        rows: list[dict[str, object]] = []
        for idn in idns if arguments.values else ():
            try:
                rows.append(facts(device.soe.describe(idn, drive=arguments.drive)))
            except (SoeError, MailboxError) as error:
                rows.append({"idn": idn, "error": one_line(error.message)})
    if arguments.json:
        print(json.dumps(rows if arguments.values else [{"idn": idn} for idn in idns]))
    elif arguments.values:
        for row in rows:
            print(line(row))
    else:
        print("\n".join(idns))
    return 0


def run_command(arguments: argparse.Namespace) -> int:
    idn = _idn(arguments)
    with _device(arguments) as device:
        device.soe.command(idn, drive=arguments.drive, timeout=arguments.timeout)
    if arguments.json:
        print(json.dumps({"idn": idn, "drive": arguments.drive, "done": True}))
    else:
        print(f"{escaped(str(device.station))}: {idn} done")
    return 0

"""Commands with the target `share:NAME`: requests to the program that owns a share."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from catenary.cli.arguments import AliasPlace
from catenary.cli.failure import UsageError, one_line
from catenary.cli.tables import table
from catenary.cli.text import escaped

if TYPE_CHECKING:
    from catenary.remote import Client
    from catenary.remote.messages import Device, ObjectEntry, SdoValue

PREFIX = "share:"
LONG = 60.0  # [s] deadline of requests that a person waits for
SCAN_HEADINGS = ("pos", "name", "order", "vendor", "product", "revision", "serial", "state")


def names_share(target: str) -> bool:
    """Return True for a target such as "share:arm"."""
    return target.strip().startswith(PREFIX)


def require_interface(target: str, missing: str) -> None:
    """Raise UsageError if the target is a share.

    Args:
        target: Target of the command.
        missing: What the command needs and a share does not offer.
    """
    if names_share(target):
        raise UsageError(
            f"a share offers no {missing}: the program that owns the interface must be stopped",
            hint="stop the program and give the interface, such as eth0",
        )


def connect_to(target: str) -> Client:
    """Connect to the program of a share, such as "share:arm"."""
    from catenary.remote import connect

    return connect(target.strip().removeprefix(PREFIX), timeout=LONG)


def position_in(program: Client, place: int | AliasPlace | None) -> int | None:
    """Return the position of a place among the devices of a program; None for None."""
    if not isinstance(place, AliasPlace):
        return place
    from catenary.cli.devices import position_of

    return position_of(place, [each.alias for each in program.devices()])


# scan, state


def scan(arguments: argparse.Namespace) -> int:
    """List the devices of the program."""
    with connect_to(arguments.target) as program:
        devices = program.devices()
    rows = [(str(each.position), each.name, each.order, *_numbers(each)) for each in devices]
    print(_json(map(_scan_fields, devices)) if arguments.json else table([SCAN_HEADINGS, *rows]))
    return 0


def _numbers(device: Device) -> tuple[str, ...]:
    identity = (device.vendor, device.product, device.revision)
    hexadecimal = (f"0x{number:08X}" for number in identity)
    return (*hexadecimal, str(device.serial), device.state or "no answer")


def _scan_fields(device: Device) -> dict[str, object]:
    names = ("position", "name", "order", "vendor", "product", "revision", "serial", "state")
    error = None if device.state else "no answer"
    return {name: getattr(device, name) for name in names} | {"esi": None, "error": error}


def state(arguments: argparse.Namespace) -> int:
    """Show the states of the devices, or change that of one device."""
    if arguments.state is not None and arguments.position is None:
        raise UsageError(
            "the state of a running program's devices is changed one by one", hint="add --position"
        )
    with connect_to(arguments.target) as program:
        position = position_in(program, arguments.position)
        if arguments.state is not None and position is not None:
            program.set_state(position, arguments.state, force=arguments.force)
        devices = program.devices()
    chosen = [each for each in devices if position in (None, each.position)]
    if not chosen:
        raise UsageError(f"there is no device {position}; the program has {len(devices)} devices")
    rows = [(str(each.position), each.name, _state_name(each), _reason(each)) for each in chosen]
    head = ("pos", "name", "state", "")
    print(_json(map(_state_fields, chosen)) if arguments.json else table([head, *rows]))
    return int(any(each.error or each.lost for each in chosen))


def _state_name(device: Device) -> str:
    return (device.state or "no answer") + " + ERROR" * device.error


def _reason(device: Device) -> str:
    code = device.al_status_code
    return f"0x{code:04X}: {device.al_status_text}" if device.error or code else ""


def _state_fields(device: Device) -> dict[str, object]:
    return {
        "position": device.position,
        "name": device.name,
        "state": device.state,
        "error": device.error,
        "code": device.al_status_code,
        "text": device.al_status_text,
        "refused": None,
    }


# diag, reg


def diag(arguments: argparse.Namespace) -> int:
    """Find the cable or device at fault."""
    if arguments.seconds is not None:
        raise UsageError(
            "--seconds sends frames, which a running loop does anyway",
            hint="use --clear, wait, and repeat the command",
        )
    with connect_to(arguments.target) as program:
        found = program.diagnosis()
        if arguments.clear:
            program.clear_counters()
    findings = [
        {
            "kind": each.kind,
            "where": each.where,
            "evidence": each.what,
            "advice": each.advice,
            "devices": each.devices,
        }
        for each in found.problems
    ]
    print(json.dumps({"findings": findings}, indent=2) if arguments.json else found.text)
    return int(bool(found.problems))


def read_register(arguments: argparse.Namespace, address: int, size: int) -> bytes:
    """Read a register of a device."""
    with connect_to(arguments.target) as program:
        arguments.position = position_in(program, arguments.position)
        return program.registers(arguments.position, address, size)


# sdo


def sdo_read(arguments: argparse.Namespace) -> SdoValue:
    """Read an object."""
    at = arguments.entry
    with connect_to(arguments.target) as program:
        arguments.position = position_in(program, arguments.position)
        return program.sdo_read(arguments.position, at.index, at.subindex, type=arguments.type)


def sdo_write(arguments: argparse.Namespace) -> SdoValue:
    """Write an object. Without --type, the type is that of the device's description."""
    at, value = arguments.entry, arguments.value
    with connect_to(arguments.target) as program:
        arguments.position = position_in(program, arguments.position)
        return program.sdo_write(
            arguments.position, at.index, at.subindex, value, type=arguments.type
        )


def sdo_list(arguments: argparse.Namespace) -> int:
    """List all objects of a device."""
    notes: list[str] = []
    with connect_to(arguments.target) as program:
        arguments.position = position_in(program, arguments.position)
        entries = _entries(program, arguments.position, notes)
        values = ((each, _value(program, arguments, each)) for each in entries)
        if arguments.json:
            print(_json(_entry_fields(each, *value) for each, value in values))
        else:
            for each, (value, problem) in values:
                print(_entry_line(each, value, problem))
    for note in notes:
        print(f"note: {one_line(note)}", file=sys.stderr)
    return 0


def _entries(program: Client, position: int, notes: list[str]) -> Iterator[ObjectEntry]:
    after: int | None = None
    while True:
        page = program.objects(position, after)
        notes += page.notes
        yield from page.entries
        if page.next is None:
            return
        after = page.next


def _value(
    program: Client, arguments: argparse.Namespace, entry: ObjectEntry
) -> tuple[SdoValue | None, str]:
    """Return the value of an entry, and the reason if it cannot be read."""
    from catenary.errors import MailboxError, ResponseTimeout, SdoAbort

    if not arguments.values or not entry.access.startswith("r"):
        return None, ""
    try:
        return program.sdo_read(arguments.position, entry.index, entry.subindex), ""
    except SdoAbort as error:
        return None, f"refused with 0x{error.code:08X}"
    except (MailboxError, ResponseTimeout) as error:
        return None, error.message


def _entry_line(entry: ObjectEntry, value: SdoValue | None, problem: str) -> str:
    place = f"0x{entry.index:04X}:{entry.subindex:02X}"
    shown = f" = {escaped(value.text)}" if value is not None else ""
    reason = f"  ({one_line(problem)})" if problem else ""
    return f"{place:9}  {entry.type:14}  {entry.access:9}  {escaped(entry.name)}{shown}{reason}"


def _entry_fields(entry: ObjectEntry, value: SdoValue | None, problem: str) -> dict[str, object]:
    return {
        "index": entry.index,
        "subindex": entry.subindex,
        "name": entry.name,
        "type": entry.type,
        "bits": entry.bits,
        "access": entry.access,
        "value": None if value is None else plain(value.value),
        "problem": problem or None,
    }


def plain(value: Any) -> object:
    """Return a value for JSON: bytes as hexadecimal digits."""
    return value.hex() if isinstance(value, bytes) else value


def _json(items: Iterator[dict[str, object]]) -> str:
    return json.dumps(list(items), indent=2)

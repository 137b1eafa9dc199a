"""`catenary state TARGET [STATE]`: show or change the EtherCAT states of devices."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING

from catenary.cli import share_target
from catenary.cli.arguments import place
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_target,
    note_other_masters,
)

if TYPE_CHECKING:
    from catenary.bus import SubDevice
    from catenary.errors import CatenaryError
    from catenary.procedure.al_state import DeviceState

STATES = "INIT, PREOP, SAFEOP, OP, BOOT"


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "state",
        help="show or change the states of devices",
        description="Shows the state and AL status code of each device without changing it. With "
        "STATE, brings the devices to this state and leaves them there. The command requests OP "
        "without process data, which devices with outputs refuse; use a Loop for them.",
        example="catenary state eth0\n"
        "catenary state eth0 PREOP\n"
        "catenary state eth0 SAFEOP --position 2",
    )
    add_target(parser)
    parser.add_argument("state", metavar="STATE", nargs="?", type=state_name, help=STATES)
    parser.add_argument(
        "--position",
        "-p",
        metavar="N",
        type=place,
        help="only this device; 0 is the first; or @ALIAS",
    )
    add_force(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def state_name(text: str) -> str:
    """Return the name of a state in `wire.al.AlState`."""
    from catenary.wire.al import AlState

    try:
        return AlState.from_name(text).name
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice
    from catenary.wire.al import AlState

    if share_target.names_share(arguments.target):
        return share_target.state(arguments)
    reads = arguments.state is None
    with MainDevice(arguments.target, force=reads or arguments.force) as main:
        if reads:
            note_other_masters(main)
        devices = main.passive_scan()
        if arguments.position is not None:
            arguments.position = device_at(devices, arguments.position).position
        chosen = range(len(devices)) if arguments.position is None else [arguments.position]
        errors: dict[int, CatenaryError] = {}
        if arguments.state is not None:
            outcomes = main.request_states(devices, chosen, AlState[arguments.state])
            errors = {p: each for p, each in outcomes.items() if isinstance(each, Exception)}
        rows = [(devices[p], devices[p].read_state()) for p in chosen]
    print(as_json(rows, errors) if arguments.json else as_table(rows))
    return report_errors(rows, errors)


def as_table(rows: Iterable[tuple[SubDevice, DeviceState]]) -> str:
    from catenary.cli.tables import table

    lines = [
        (str(device.position), device.name, now.name + " + ERROR" * now.error, reason(now))
        for device, now in rows
    ]
    return table([("pos", "name", "state", ""), *lines])


def reason(now: DeviceState) -> str:
    from catenary.wire.al import status_code

    return f"0x{now.code:04X}: {status_code(now.code).text}" if now.error or now.code else ""


def as_json(rows: Iterable[tuple[SubDevice, DeviceState]], errors: dict[int, CatenaryError]) -> str:
    from catenary.wire.al import status_code

    return json.dumps(
        [
            {
                "position": device.position,
                "name": device.name,
                "state": now.name,
                "error": now.error,
                "code": now.code,
                "text": status_code(now.code).text,
                "refused": str(errors[device.position].message)
                if device.position in errors
                else None,
            }
            for device, now in rows
        ],
        indent=2,
    )


def report_errors(
    rows: Iterable[tuple[SubDevice, DeviceState]], errors: dict[int, CatenaryError]
) -> int:
    """Print errors to stderr. Return the exit status."""
    from catenary.cli.failure import with_hint

    for error in errors.values():
        print(f"catenary: {with_hint(error)}", file=sys.stderr)
    return int(bool(errors) or any(now.error for _, now in rows))

"""Lists of the devices of a segment, as a table and as JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence

from catenary.bus import SubDevice
from catenary.cli.arguments import AliasPlace
from catenary.cli.failure import UsageError, with_hint
from catenary.cli.tables import table

HEADINGS = ("pos", "name", "order", "vendor", "product", "revision", "serial", "state")


def as_table(devices: Sequence[SubDevice]) -> str:
    return table([HEADINGS, *(_row(device) for device in devices)])


def _row(device: SubDevice) -> tuple[str, ...]:
    identity = device.identity
    return (
        str(device.position),
        device.name,
        device.order,
        f"0x{identity.vendor:08X}",
        f"0x{identity.product:08X}",
        f"0x{identity.revision:08X}",
        str(identity.serial),
        state_name(device),
    )


def state_name(device: SubDevice) -> str:
    if device.error is not None:
        return "failed"
    return str(device.state) if device.state is not None else "unknown"


def as_json(devices: Sequence[SubDevice]) -> str:
    return json.dumps(
        [
            {
                "position": device.position,
                "name": device.name,
                "order": device.order,
                "vendor": device.identity.vendor,
                "product": device.identity.product,
                "revision": device.identity.revision,
                "serial": device.identity.serial,
                "state": state_name(device),
                "esi": None if device.esi is None else str(device.esi.source),
                "error": None if device.error is None else str(device.error),
            }
            for device in devices
        ],
        indent=2,
    )


def device_at(devices: Sequence[SubDevice], place: int | AliasPlace) -> SubDevice:
    """Return the device at a position, or with a station alias.

    Raises:
        UsageError: There is no such device, or several devices have the alias.
    """
    position = position_of(place, [each.alias for each in devices])
    if position >= len(devices):
        raise UsageError(
            f"there is no device {position}; the segment has {len(devices)} devices",
            hint=f"use a position from 0 to {len(devices) - 1}; `catenary scan` lists the devices",
        )
    return devices[position]


def position_of(place: int | AliasPlace, aliases: Sequence[int]) -> int:
    """Return the position of a place.

    Args:
        place: Position, or place by alias.
        aliases: Station alias of each device; 0 if it has none.

    Raises:
        UsageError: No device, or several devices have the alias.
    """
    if isinstance(place, int):
        return place
    found = [position for position, alias in enumerate(aliases) if alias == place.alias]
    if len(found) == 1:
        return found[0] + place.offset
    known = ", ".join(str(each) for each in sorted({*aliases} - {0})) or "none"
    number = "no device has" if not found else f"{len(found)} devices have"
    raise UsageError(f"{number} the alias {place.alias}", hint=f"aliases: {known}")


def report_failures(devices: Sequence[SubDevice]) -> int:
    """Print the errors of devices that a scan could not bring up. Return the exit status."""
    errors = [device.error for device in devices if device.error is not None]
    for error in errors:
        print(f"error: {with_hint(error)}", file=sys.stderr)
    return 1 if errors else 0

"""`catenary alias TARGET POSITION [VALUE]`: show or write the station alias of a device."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

from catenary.cli.arguments import number
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_json,
    add_position,
    add_target,
    note_other_masters,
)

if TYPE_CHECKING:
    from catenary.bus import MainDevice, SubDevice


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "alias",
        help="show or write the station alias of a device",
        description="Shows the station alias, by which a program finds a device at any position. "
        "With VALUE, writes the alias to the EEPROM. The device uses it after its next power-up.",
        example="catenary alias eth0 2\ncatenary alias eth0 2 10\ncatenary alias eth0 2 0",
    )
    add_target(parser)
    add_position(parser)
    parser.add_argument(
        "value", metavar="VALUE", nargs="?", type=alias, help="1 to 65535; 0 for none"
    )
    parser.add_argument(
        "--force", action="store_true", help="write the alias even if another device has it"
    )
    add_json(parser)
    parser.set_defaults(run=run)


def alias(text: str) -> int:
    value = number(text)
    if not 0 <= value <= 0xFFFF:
        raise argparse.ArgumentTypeError(f"alias {value} is outside 0 to 65535")
    return value


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.procedure.alias import read_alias, write_alias
    from catenary.procedure.sii_owner import with_eeprom
    from catenary.target import MainDevice

    reads = arguments.value is None
    with MainDevice(arguments.target, force=reads) as main:
        if reads:
            note_other_masters(main)
        devices = main.passive_scan()
        device = device_at(devices, arguments.position)
        if arguments.value is not None:
            if arguments.value and not arguments.force:
                check_unique(main, devices, device, arguments.value)
            main.converse(with_eeprom(device.station, write_alias(device.station, arguments.value)))
        stored = main.converse(with_eeprom(device.station, read_alias(device.station)))
    if arguments.json:
        found = {"position": device.position, "alias": device.alias, "eeprom": stored}
        print(json.dumps(found | {"name": device.name}))
    else:
        print(show(device, stored))
    return 0


def check_unique(
    main: MainDevice, devices: Sequence[SubDevice], device: SubDevice, value: int
) -> None:
    """Check that no other device has the alias, now or after its next power-up.

    Raises:
        ConfigurationError: Another device has the alias.
    """
    from catenary.errors import ConfigurationError
    from catenary.procedure.alias import read_alias
    from catenary.procedure.sii_owner import with_eeprom

    for other in devices:
        if other is device:
            continue
        stored = main.converse(with_eeprom(other.station, read_alias(other.station)))
        if value in (other.alias, stored):
            raise ConfigurationError(
                f"{other.station} already has the alias {value}",
                hint="choose another alias, or use --force if that device also gets a new alias",
            )


def show(device: SubDevice, stored: int) -> str:
    from catenary.cli.text import escaped

    name = escaped(str(device.station))
    now = f"alias {device.alias}" if device.alias else "no alias"
    if stored == device.alias:
        return f"{name}: {now}"
    then = f"alias {stored}" if stored else "no alias"
    return f"{name}: {now}; {then} after the next power-up"

"""`catenary aoe info|read|write TARGET POSITION`: ADS data of a device (AoE)."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from catenary.cli.arguments import number, positive_number
from catenary.cli.failure import UsageError
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_position,
    add_target,
)
from catenary.cli.share_target import require_interface

if TYPE_CHECKING:
    from catenary.bus import MainDevice, SubDevice

DEVICE_PORT = 0xFFFF


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "aoe",
        help="read or write ADS data of a device",
        description="Reads or writes ADS data of a device (ADS over EtherCAT). IO-Link masters "
        "offer the parameters of their devices in this way.",
        example="catenary aoe info eth0 2\n"
        "catenary aoe read eth0 2 0xF302 0x00120000 64 --port 0x1001",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_info(group)
    _add_read(group)
    _add_write(group)


def _add_info(group: Commands) -> None:
    info = add_command(
        group,
        "info",
        help="show name, version and state",
        description="Shows the name, the version and the ADS state of the device.",
        example="catenary aoe info eth0 2",
    )
    _add_common(info)
    info.set_defaults(run=run_info)


def _add_read(group: Commands) -> None:
    reading = add_command(
        group,
        "read",
        help="read data",
        description="Reads SIZE bytes at an index group and an index offset.",
        example="catenary aoe read eth0 2 0xF302 0x10180001 4",
    )
    _add_common(reading)
    _add_place(reading)
    reading.add_argument("size", metavar="SIZE", type=positive_number, help="number of bytes")
    reading.set_defaults(run=run_read)


def _add_write(group: Commands) -> None:
    writing = add_command(
        group,
        "write",
        help="write data",
        description="Writes bytes at an index group and an index offset.",
        example="catenary aoe write eth0 2 0xF302 0x00180000 '50 75 6d 70' --port 0x1001",
    )
    _add_common(writing)
    _add_place(writing)
    writing.add_argument("data", metavar="DATA", help="pairs of hexadecimal digits: '01 02 0a'")
    writing.set_defaults(run=run_write)


def _add_common(parser: argparse.ArgumentParser) -> None:
    add_target(parser)
    add_position(parser)
    parser.add_argument(
        "--port",
        metavar="N",
        type=number,
        default=DEVICE_PORT,
        help="ADS port in the device, such as 0x1001 (default: 0xFFFF, the device itself)",
    )
    add_force(parser)
    add_json(parser)


def _add_place(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("group", metavar="GROUP", type=number, help="index group")
    parser.add_argument("offset", metavar="OFFSET", type=number, help="index offset")


def _device(main: MainDevice, arguments: argparse.Namespace) -> SubDevice:
    from catenary.cli.devices import device_at

    return device_at(main.scan(strict=False), arguments.position)


def run_info(arguments: argparse.Namespace) -> int:
    from catenary.cli.text import escaped
    from catenary.target import MainDevice

    require_interface(arguments.target, "ADS data")
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = _device(main, arguments)
        info = device.aoe.device_info(port=arguments.port)
        state = device.aoe.state(port=arguments.port)
    version = f"{info.version}.{info.revision}.{info.build}"
    found = {
        "position": device.position,
        "net_id": device.aoe.net_id,
        "name": info.name,
        "version": version,
        "state": state.name,
        "device_state": state.device_state,
    }
    if arguments.json:
        print(json.dumps(found))
        return 0
    print(f"{escaped(str(device.station))}: {escaped(info.name)}, version {version}")
    print(f"state {state.name}, device state {state.device_state}, NetId {device.aoe.net_id}")
    return 0


def run_read(arguments: argparse.Namespace) -> int:
    from catenary.target import MainDevice

    require_interface(arguments.target, "ADS data")
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = _device(main, arguments)
        data = device.aoe.read(
            arguments.group, arguments.offset, arguments.size, port=arguments.port
        )
    if arguments.json:
        print(json.dumps({"position": device.position, "data": data.hex()}))
    else:
        print(data.hex(" "))
    return 0


def run_write(arguments: argparse.Namespace) -> int:
    from catenary.cli.text import escaped
    from catenary.target import MainDevice

    require_interface(arguments.target, "ADS data")
    try:
        data = bytes.fromhex(arguments.data)
    except ValueError:
        raise UsageError(
            f"{arguments.data!r} is not bytes", hint="write pairs of hexadecimal digits: '01 02 0a'"
        ) from None
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = _device(main, arguments)
        device.aoe.write(arguments.group, arguments.offset, data, port=arguments.port)
    if arguments.json:
        print(json.dumps({"position": device.position, "size": len(data)}))
    else:
        print(f"{escaped(str(device.station))}: {len(data)} bytes written")
    return 0

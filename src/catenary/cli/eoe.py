"""`catenary eoe up|address TARGET`: Ethernet ports of devices (EoE)."""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from dataclasses import asdict
from typing import TYPE_CHECKING

from catenary.cli.arguments import number, positive_seconds
from catenary.cli.failure import UsageError, one_line
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_optional_position,
    add_position,
    add_target,
)
from catenary.cli.share_target import names_share

if TYPE_CHECKING:
    from catenary.bus import EthernetBridge, EthernetCounts, MainDevice
    from catenary.wire.eoe_address import EthernetAddress

FIELDS = ("ip", "mask", "gateway", "dns", "mac", "name")
LABELS = {"ip": "IP", "mask": "mask", "gateway": "gateway", "dns": "DNS", "mac": "MAC"}
CHECK = 1.0  # [s] between two checks for events


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "eoe",
        help="reach the Ethernet port of a device",
        description="Connects Ethernet ports of devices (Ethernet over EtherCAT) to a TAP "
        "interface of this machine, and shows or sets their addresses. In a running program, use "
        "sub.eoe: a share offers no Ethernet ports.",
        example="catenary eoe address eth0 2 --ip 192.168.7.2/24\n"
        "catenary eoe up eth0 2 --tap cat0",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_up(group)
    _add_address(group)


def _add_up(group: Commands) -> None:
    up = add_command(
        group,
        "up",
        help="connect a TAP interface to devices, until Ctrl-C",
        description="Brings all devices to PRE-OP, and connects a TAP interface of this machine to "
        "one device, or without POSITION to all devices with EoE in their SII. Create the TAP "
        "before, and give it an address in the network of the device:\n"
        "  sudo ip tuntap add dev cat0 mode tap user $USER\n"
        "  sudo ip link set cat0 up\n"
        "  sudo ip address add 192.168.7.1/24 dev cat0\n"
        "Nothing is forwarded to other interfaces. With --json, the statistics are printed at the "
        "end.",
        example="catenary eoe up eth0 2 --tap cat0\ncatenary eoe up eth0 --tap cat0 --seconds 60",
    )
    add_target(up)
    add_optional_position(up)
    up.add_argument("--tap", metavar="NAME", required=True, help="name of the TAP interface")
    up.add_argument(
        "--forward", action="store_true", help="also forward frames between the devices"
    )
    up.add_argument(
        "--seconds", metavar="SECONDS", type=positive_seconds, help="end after this time"
    )
    add_force(up)
    add_json(up)
    up.set_defaults(run=run_up)


def _add_address(group: Commands) -> None:
    address = add_command(
        group,
        "address",
        help="show or set the addresses of a device",
        description="Sets the given addresses of the Ethernet port of a device, and shows all "
        "addresses that it reports. Many devices lose them with their power.",
        example="catenary eoe address eth0 2\n"
        "catenary eoe address eth0 2 --ip 192.168.7.2/24 --gateway 192.168.7.1",
    )
    add_target(address)
    add_position(address)
    address.add_argument("--ip", metavar="IP", help="IP address, also with its mask: 10.0.0.2/24")
    address.add_argument("--mask", metavar="MASK", help="mask, such as 255.255.255.0")
    address.add_argument("--gateway", metavar="IP", help="IP address of the gateway")
    address.add_argument("--dns", metavar="IP", help="IP address of the name server")
    address.add_argument("--mac", metavar="MAC", help="MAC address, such as 02:00:00:00:00:01")
    address.add_argument("--name", metavar="NAME", help="host name, up to 32 characters")
    address.add_argument(
        "--port", metavar="N", type=number, default=0, help="port of the device (default: 0)"
    )
    add_force(address)
    add_json(address)
    address.set_defaults(run=run_address)


def _require_interface(arguments: argparse.Namespace) -> None:
    """Raise UsageError if the target is a share."""
    if names_share(arguments.target):
        raise UsageError(
            "a share offers no Ethernet ports",
            hint="use sub.eoe in the program of the share, or stop it and give the interface",
        )


def run_address(arguments: argparse.Namespace) -> int:
    from catenary.bus.eoe import make_address
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    _require_interface(arguments)
    wanted = {name: getattr(arguments, name) for name in FIELDS}
    changes = any(value is not None for value in wanted.values())
    if changes:
        try:
            make_address(**wanted)  # before anything is sent
        except ValueError as error:
            raise UsageError(str(error)) from error
    with MainDevice(arguments.target, force=arguments.force) as main:
        device = device_at(main.scan(strict=False), arguments.position)
        if changes:
            device.eoe.set_address(**wanted, port=arguments.port)
        address = device.eoe.address(port=arguments.port)
    print(json.dumps(_fields(address)) if arguments.json else _text(str(device.station), address))
    return 0


def _fields(address: EthernetAddress) -> dict[str, str | None]:
    found = {name: getattr(address, name) for name in FIELDS}
    shown = {name: None if value is None else str(value) for name, value in found.items()}
    return shown | {"mac": None if address.mac is None else address.mac.hex(":")}


def _text(station: str, address: EthernetAddress) -> str:
    from catenary.cli.text import escaped

    lines = [escaped(station)]
    for name, value in _fields(address).items():
        shown = "not reported" if value is None else escaped(value)
        lines.append(f"  {LABELS.get(name, name) + ':':9}{shown}")
    return "\n".join(lines)


def run_up(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    _require_interface(arguments)
    with MainDevice(arguments.target, force=arguments.force) as main:
        subs = main.scan(strict=False)
        chosen = None
        if arguments.position is not None:
            chosen = [device_at(subs, arguments.position)]
        with main.eoe.connect(arguments.tap, chosen, forward=arguments.forward) as bridge:
            if not arguments.json:
                _print_connections(main, bridge)
            _wait(main, arguments.seconds)
            counts = bridge.counts
    if arguments.json:
        devices = [_count(*each) for each in counts.items()]
        print(json.dumps({"tap": arguments.tap, "devices": devices}))
    return 0


def _print_connections(main: MainDevice, bridge: EthernetBridge) -> None:
    from catenary.cli.text import escaped

    for position in bridge.positions:
        print(f"{bridge.name} - {escaped(str(main.subs[position].station))}")
    print("connected; Ctrl-C ends the connection", flush=True)


def _wait(main: MainDevice, seconds: float | None) -> None:
    """Print events until Ctrl-C, or until the time is over."""
    end = None if seconds is None else time.monotonic() + seconds
    never = threading.Event()
    try:
        while end is None or time.monotonic() < end:
            never.wait(CHECK if end is None else min(CHECK, max(end - time.monotonic(), 0)))
            for event in main.events:
                print(f"note: {one_line(event.message)}", file=sys.stderr)
    except KeyboardInterrupt:
        return


def _count(position: int, counts: EthernetCounts) -> dict[str, object]:
    return {"position": position, **asdict(counts)}

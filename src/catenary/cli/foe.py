"""`catenary foe read|write TARGET POSITION FILE`: transfer files of a device (FoE)."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from catenary.cli.arguments import password, positive_number, positive_seconds
from catenary.cli.failure import UsageError
from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_position,
    add_target,
)
from catenary.cli.progress import TransferProgress
from catenary.cli.sdo_value import write_bytes
from catenary.cli.share_target import require_interface

if TYPE_CHECKING:
    from catenary.bus import MainDevice, SubDevice

STDIO = "-"


def add_parser(commands: Commands) -> None:
    group = add_command(
        commands,
        "foe",
        help="read or write a file of a device",
        description="Reads or writes a file of a device (File over EtherCAT). For a firmware, use "
        "`catenary firmware`, which also restarts and verifies the device.",
        example="catenary foe read eth0 2 log.txt\n"
        "catenary foe write eth0 2 parameters.bin --name PARAM --password 0x1234",
    ).add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_read(group)
    _add_write(group)


def _add_read(group: Commands) -> None:
    reading = add_command(
        group,
        "read",
        help="read a file",
        description="Reads a file of the device into FILE.",
        example="catenary foe read eth0 2 log.txt\n"
        "catenary foe read eth0 2 - --name log.txt | less",
    )
    _add_common(reading, "file to write on this machine; - is stdout")
    reading.add_argument(
        "--max-size", metavar="BYTES", type=positive_number, help="largest accepted file"
    )
    reading.set_defaults(run=run_read)


def _add_write(group: Commands) -> None:
    writing = add_command(
        group,
        "write",
        help="write a file",
        description="Writes FILE to the device.",
        example="catenary foe write eth0 2 parameters.bin --name PARAM",
    )
    _add_common(writing, "file to read on this machine; - is stdin")
    writing.set_defaults(run=run_write)


def _add_common(parser: argparse.ArgumentParser, help: str) -> None:
    add_target(parser)
    add_position(parser)
    parser.add_argument("file", metavar="FILE", help=help)
    add_transfer_options(parser)
    parser.add_argument(
        "--boot", action="store_true", help="bring the device to BOOT for the transfer"
    )
    add_force(parser)
    add_json(parser)


def add_transfer_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of each transfer.

    Args:
        parser: The parser of the command.
    """
    parser.add_argument(
        "--name", metavar="NAME", help="name of the file in the device (default: that of FILE)"
    )
    parser.add_argument(
        "--password", metavar="N", type=password, default=0, help="password, such as 0x1234"
    )
    parser.add_argument(
        "--timeout",
        metavar="SECONDS",
        type=positive_seconds,
        default=10.0,
        help="longest time until the device answers a packet (default: 10)",
    )
    parser.add_argument(
        "--busy-timeout",
        metavar="SECONDS",
        type=positive_seconds,
        default=120.0,
        help="longest time for which the device may be busy with one packet (default: 120)",
    )


def name_in_device(arguments: argparse.Namespace) -> str:
    """Return the name of the file in the device."""
    if arguments.name is None and arguments.file == STDIO:
        raise UsageError("foe needs a file name", hint="add --name NAME")
    name: str = Path(arguments.file).name if arguments.name is None else arguments.name
    return name


def contents(arguments: argparse.Namespace) -> bytes:
    """Return the contents of FILE, or of stdin for "-"."""
    from catenary.bus.foe import contents_of
    from catenary.procedure.foe import MAX_SIZE

    if arguments.file != STDIO:
        return contents_of(Path(arguments.file))
    data = sys.stdin.buffer.read(MAX_SIZE + 1)
    if len(data) > MAX_SIZE:
        raise UsageError(f"stdin exceeds {MAX_SIZE} bytes")
    return data


def _require_folder(path: Path) -> None:
    """Raise UsageError if a file cannot be written because of its folder."""
    if path.is_dir():
        raise UsageError(f"{path} is a folder: a file is needed", hint=f"{path}/NAME")
    if not path.parent.is_dir():
        raise UsageError(f"the folder {path.parent} does not exist", hint=f"mkdir {path.parent}")


def run_read(arguments: argparse.Namespace) -> int:
    from catenary.procedure.foe import MAX_SIZE
    from catenary.target import MainDevice

    require_interface(arguments.target, "files")
    name = name_in_device(arguments)
    _require_folder(Path(arguments.file))
    with (
        MainDevice(arguments.target, force=arguments.force) as main,
        TransferProgress("reading") as progress,
    ):
        device = _prepared(main, arguments)
        data = device.foe.read(
            name,
            password=arguments.password,
            max_size=arguments.max_size or MAX_SIZE,
            progress=lambda done, total: progress.report(done, total, device.foe.busy),
            timeout=arguments.timeout,
            busy_timeout=arguments.busy_timeout,
        )
    write_bytes(arguments.file, data)
    if arguments.file != STDIO:
        _report(arguments, device, name, len(data), "read")
    return 0


def run_write(arguments: argparse.Namespace) -> int:
    from catenary.target import MainDevice

    require_interface(arguments.target, "files")
    name, data = name_in_device(arguments), contents(arguments)
    with (
        MainDevice(arguments.target, force=arguments.force) as main,
        TransferProgress("writing") as progress,
    ):
        device = _prepared(main, arguments)
        device.foe.write(
            name,
            data,
            password=arguments.password,
            progress=lambda done, total: progress.report(done, total, device.foe.busy),
            timeout=arguments.timeout,
            busy_timeout=arguments.busy_timeout,
        )
    _report(arguments, device, name, len(data), "written")
    return 0


def _prepared(main: MainDevice, arguments: argparse.Namespace) -> SubDevice:
    """Scan the segment, and return the device. Bring it to BOOT if `--boot` is given.

    The end of the MainDevice brings it to INIT, like all devices.
    """
    from catenary.cli.devices import device_at

    device = device_at(main.scan(strict=False), arguments.position)
    if arguments.boot:
        device.request_state("INIT")
        device.request_state("BOOT")
    return device


def _report(
    arguments: argparse.Namespace, device: SubDevice, name: str, size: int, done: str
) -> None:
    from catenary.cli.text import escaped

    if arguments.json:
        print(json.dumps({"position": device.position, "name": name, "size": size}))
    else:
        print(f"{escaped(str(device.station))}: {size} bytes {done}: {escaped(name)}")

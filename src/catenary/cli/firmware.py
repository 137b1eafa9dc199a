"""`catenary firmware TARGET POSITION FILE`: update the firmware of a device."""

from __future__ import annotations

import argparse
import json
import sys
from typing import TYPE_CHECKING

from catenary.cli.arguments import number, positive_seconds
from catenary.cli.failure import UsageError, one_line, with_hint
from catenary.cli.foe import add_transfer_options, contents, name_in_device
from catenary.cli.parsers import Commands, add_command, add_json, add_position, add_target
from catenary.cli.progress import TransferProgress, transfer_text
from catenary.cli.share_target import require_interface
from catenary.cli.text import escaped

if TYPE_CHECKING:
    from catenary.bus import SubDevice
    from catenary.bus.firmware_result import FirmwareOptions, FirmwareResult
    from catenary.bus.firmware_version import Reported


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "firmware",
        help="update the firmware of a device",
        description="Updates the firmware of a device: checks its identity, brings it to BOOT, "
        "writes FILE, restarts it, and compares identity and version (objects 0x1018 and 0x100A). "
        "After a failure, the command reports the state of the device and the next step. It "
        "refuses to start while another master uses the interface, or a device is in OP.",
        example="catenary firmware eth0 2 app.efw --password 0x1234 --expect-version 2.1\n"
        "catenary firmware eth0 2 drive_2_1.efw --name app.efw --product 0x044C2C52",
    )
    add_target(parser)
    add_position(parser)
    parser.add_argument("file", metavar="FILE", help="firmware file of the vendor")
    add_transfer_options(parser)
    _add_checks(parser)
    parser.add_argument(
        "--force",
        action="store_true",
        help="continue even if another master uses the interface, or a device is in OP",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def _add_checks(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--vendor", metavar="N", type=number, help="vendor ID that the device must have"
    )
    parser.add_argument(
        "--product", metavar="N", type=number, help="product code that the device must have"
    )
    parser.add_argument(
        "--expect-version", metavar="TEXT", help="version that 0x100A must have afterwards"
    )
    parser.add_argument(
        "--read-back", action="store_true", help="read the file back in BOOT, and compare it"
    )
    parser.add_argument(
        "--restart-timeout",
        metavar="SECONDS",
        type=positive_seconds,
        default=60.0,
        help="longest time until the device returns with its new firmware (default: 60)",
    )


def run(arguments: argparse.Namespace) -> int:
    from catenary.bus.firmware import FirmwareUpdate, require_idle
    from catenary.cli.devices import device_at
    from catenary.target import MainDevice

    require_interface(arguments.target, "files")
    options, data = _options(arguments), contents(arguments)
    if not data:  # a device erases its memory before it receives the first byte
        raise UsageError(f"{arguments.file} is empty", hint="give the firmware file of the vendor")
    with (
        MainDevice(arguments.target, force=arguments.force) as main,
        TransferProgress("writing") as progress,
    ):
        if not arguments.force:
            require_idle(main)
        device = device_at(main.scan(strict=False), arguments.position)
        result = FirmwareUpdate(
            main,
            device.position,
            data,
            options,
            progress=lambda done, total: progress.report(done, total, device.foe.busy),
            on_step=progress.show,
        ).run()
    if arguments.json:
        print(json.dumps(as_json(device, len(data), result), indent=2))
    else:
        print_result(device, len(data), result)
    return int(result.error is not None)


def _options(arguments: argparse.Namespace) -> FirmwareOptions:
    from catenary.bus.firmware_result import FirmwareOptions

    return FirmwareOptions(
        name=name_in_device(arguments),
        password=arguments.password,
        vendor=arguments.vendor,
        product=arguments.product,
        version=arguments.expect_version,
        read_back=arguments.read_back,
        timeout=arguments.timeout,
        busy_timeout=arguments.busy_timeout,
        restart_timeout=arguments.restart_timeout,
    )


def print_result(device: SubDevice, size: int, result: FirmwareResult) -> None:
    """Print the result, and an error with the next step to stderr.

    Args:
        device: The device.
        size: Size of the file [bytes].
        result: Result of the update.
    """
    from catenary.bus.firmware_result import Step

    print(escaped(str(device.station)))
    if result.before is not None:
        print(f"  before:  {escaped(str(result.before))}")
    if result.seconds:
        print(f"  written: {size} bytes, {transfer_text(size, None, result.seconds)}")
    if result.end.reported is not None and result.step is not Step.CHECK:
        print(f"  now:     {escaped(str(result.end.reported))}")
    for note in result.notes:
        print(f"note: {one_line(note)}", file=sys.stderr)
    if result.error is not None:
        print(f"catenary: {result.step} failed: {with_hint(result.error)}", file=sys.stderr)
        print(f"  state: {_state(result)}", file=sys.stderr)
        print(f"  next:  {one_line(result.end.next_step)}", file=sys.stderr)


def _state(result: FirmwareResult) -> str:
    if result.end.state is None:
        return "it does not answer"
    return f"it reached {result.end.state}; this command leaves all devices in INIT"


def as_json(device: SubDevice, size: int, result: FirmwareResult) -> dict[str, object]:
    """Return the result as values for JSON.

    Args:
        device: The device.
        size: Size of the file [bytes].
        result: Result of the update.
    """
    return {
        "position": device.position,
        "name": device.name,
        "size": size,
        "seconds": result.seconds,
        "before": _reported(result.before),
        "now": _reported(result.end.reported),
        "state": None if result.end.state is None else str(result.end.state),
        "step": str(result.step),
        "error": None if result.error is None else result.error.message,
        "next": result.end.next_step or None,
        "notes": list(result.notes),
    }


def _reported(found: Reported | None) -> dict[str, object] | None:
    if found is None:
        return None
    return {**found.identity._asdict(), "version": found.version}

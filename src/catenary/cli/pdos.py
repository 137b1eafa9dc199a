"""`catenary pdos TARGET [POSITION]`: show the SyncManagers and the process data of devices."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING

from catenary.cli.parsers import (
    Commands,
    add_command,
    add_force,
    add_json,
    add_optional_position,
    add_target,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from catenary.bus import SubDevice
    from catenary.model.device import Pdo, SyncManager


def add_parser(commands: Commands) -> None:
    parser = add_command(
        commands,
        "pdos",
        help="show the SyncManagers and the process data of devices",
        description="Brings all devices to PRE-OP and shows their SyncManagers, the PDOs that are "
        "assigned to them, and the mapped objects. Bit offsets count from the first byte of the "
        "outputs or inputs of the device. With --all, also shows the PDOs that are not assigned.",
        example="catenary pdos eth0 2\ncatenary pdos eth0 2 --all\ncatenary pdos virtual --json",
    )
    add_target(parser)
    add_optional_position(parser)
    parser.add_argument("--all", action="store_true", help="also show PDOs that are not assigned")
    add_force(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    from catenary.cli.devices import device_at, report_failures
    from catenary.target import MainDevice

    with MainDevice(arguments.target, force=arguments.force) as main:
        devices: Sequence[SubDevice] = main.scan(strict=False)
        if arguments.position is not None:
            devices = [device_at(devices, arguments.position)]
    if arguments.json:
        print(json.dumps([as_values(each, all_pdos=arguments.all) for each in devices], indent=2))
    else:
        print("\n\n".join(as_text(each, all_pdos=arguments.all) for each in devices))
    return report_failures(devices)


def pdos_of(device: SubDevice, *, all_pdos: bool) -> list[tuple[str, int | None, Pdo]]:
    """Return direction, SyncManager and PDO of the assigned PDOs, outputs first.

    Args:
        device: The device.
        all_pdos: True also returns the PDOs without SyncManager.
    """
    from catenary.model.device import Direction

    found: list[tuple[str, int | None, Pdo]] = []
    description = device.description
    offered = {Direction.OUTPUT: description.output_pdos, Direction.INPUT: description.input_pdos}
    for direction in Direction:
        assigned = [
            (direction.noun, each.sync_manager, pdo)
            for each in description.assignments(direction)
            for pdo in each.pdos
        ]
        present = {pdo.index for _, _, pdo in assigned}
        others = [pdo for pdo in offered[direction] if pdo.index not in present]
        found += assigned + [(direction.noun, None, pdo) for pdo in others if all_pdos]
    return found


def as_text(device: SubDevice, *, all_pdos: bool) -> str:
    """Return the process data of a device as text."""
    from catenary.cli.text import escaped

    lines = [escaped(line) for line in str(device.pdos).splitlines()]
    managers = [f"  {_manager(each)}" for each in device.description.sync_managers]
    unassigned = [
        f"  0x{pdo.index:04X} {escaped(pdo.name)}: {direction}, {pdo.bit_length} bits, not assigned"
        for direction, manager, pdo in pdos_of(device, all_pdos=all_pdos)
        if manager is None
    ]
    return "\n".join([lines[0], *managers, *lines[1:], *unassigned])


def _manager(manager: SyncManager) -> str:
    use = manager.use.name.lower().replace("_", " ")
    off = "" if manager.enabled else ", disabled"
    return (
        f"SM{manager.index} {use}: 0x{manager.start:04X}, {manager.length} bytes, "
        f"control 0x{manager.control:02X}{off}"
    )


def as_values(device: SubDevice, *, all_pdos: bool) -> dict[str, object]:
    """Return the process data of a device for JSON."""
    return {
        "position": device.position,
        "name": device.name,
        "source": device.description.mapping_source,
        "sync_managers": [
            {
                "index": each.index,
                "use": each.use.name.lower(),
                "start": each.start,
                "length": each.length,
                "control": each.control,
                "enabled": each.enabled,
            }
            for each in device.description.sync_managers
        ],
        "pdos": [
            {
                "direction": direction,
                "sync_manager": manager,
                "index": pdo.index,
                "name": pdo.name,
                "bits": pdo.bit_length,
                "entries": [
                    {
                        "index": each.index,
                        "subindex": each.subindex,
                        "name": each.name,
                        "bits": each.bit_length,
                        "data_type": each.data_type,
                    }
                    for each in pdo.entries
                ],
            }
            for direction, manager, pdo in pdos_of(device, all_pdos=all_pdos)
        ],
    }

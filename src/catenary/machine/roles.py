"""Drives and process data of a machine file by the device that they need."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from catenary.machine.file import MachineFile
from catenary.machine.requests import devices_of


def roles_by_device(file: MachineFile) -> Mapping[str, tuple[str, ...]]:
    """Return the roles that need each device, such as {"j1": ("drives.arm",)}.

    Args:
        file: The machine file.
    """
    found: dict[str, list[str]] = defaultdict(list)
    kinds = (("drives", file.tables.drives), ("process_data", file.tables.process_data))
    for kind, tables in kinds:
        for role in tables:
            for device in devices_of(file, kind, role):
                found[device].append(f"{kind}.{role}")
    return {device: tuple(roles) for device, roles in found.items()}

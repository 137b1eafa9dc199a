"""Reader of a machine file, with all checks that need no devices."""

from __future__ import annotations

from pathlib import Path

from msgspec import UNSET

from catenary.machine.channels import check_channels
from catenary.machine.device_request import start_up_objects
from catenary.machine.file import MachineFile, load
from catenary.machine.options import drives_options, loop_options, process_data_options
from catenary.machine.references import check_references


def read_machine(path: str | Path) -> MachineFile:
    """Read a machine file and check it, without access to any device.

    Raises:
        MachineFileError: The file cannot be read, or it is not valid. The error names line and key.
    """
    file = load(path)
    check_references(file)
    loop_options(file)
    for number in range(len(file.tables.device)):
        start_up_objects(file, number)
    for role in file.tables.drives:
        drives_options(file, role)
    for role, table in file.tables.process_data.items():
        process_data_options(file, role)
        for name in ("inputs", "outputs"):
            given = getattr(table, name)
            if given is not UNSET:
                check_channels(file, ("process_data", role, name), given)
    return file

"""Copies between devices, made from the tables [[copy]] and [[fsoe]] of a machine file."""

from __future__ import annotations

from catenary.drive import Copies, Copy, FsoeConnection
from catenary.errors import CatenaryError
from catenary.machine.file import MachineFile
from catenary.machine.references import COPY_DEVICES
from catenary.machine.requests import Subs, devices_of
from catenary.machine.schema import CopyTable, FsoeTable
from catenary.toml_lines import KeyPath


def make_copies(file: MachineFile, subs: Subs) -> Copies | None:
    """Return the copies whose devices are present; None if there are none.

    Args:
        file: the machine file.
        subs: present devices by name.

    Raises:
        MachineFileError: A device has no such place, or a copy is not possible.
    """
    made: list[Copy | FsoeConnection] = []
    for kind, keys in COPY_DEVICES.items():
        for number, table in enumerate(getattr(file.tables, kind)):
            if all(getattr(table, key) in subs for key in keys):
                made.append(_checked(file, (kind, number), _copy(table, subs)))
    if not made:
        return None
    optional = {subs[name].position for name in _optional(file) if name in subs}
    used = Copies(*made).subs
    return Copies(*made, optional=[sub for sub in used if sub.position in optional])


def _optional(file: MachineFile) -> set[str]:
    """Return the devices with `required = false`, in their own table or in a role.

    Another role of the device may still require it.
    """
    tables = file.tables
    names = {device.name for device in tables.device if not device.required}
    for role, drives in tables.drives.items():
        if drives.required is False:
            names.update(devices_of(file, "drives", role))
    return names | {data.device for data in tables.process_data.values() if data.required is False}


def _copy(table: CopyTable | FsoeTable, subs: Subs) -> Copy | FsoeConnection:
    if isinstance(table, CopyTable):
        source, destination = subs[table.source], subs[table.destination]
        return Copy(source, table.source_place, destination, table.destination_place)
    return FsoeConnection(
        (subs[table.main], table.main_inputs, table.main_outputs),
        (subs[table.sub], table.sub_inputs, table.sub_outputs),
    )


def _checked(
    file: MachineFile, path: KeyPath, copy: Copy | FsoeConnection
) -> Copy | FsoeConnection:
    """Return a copy. Raise MachineFileError with the line of its table if it is not possible."""
    try:
        Copies(copy)
    except CatenaryError as error:
        raise file.error(path, error.message, hint=error.hint) from error
    except ValueError as error:
        raise file.error(path, str(error)) from error
    return copy

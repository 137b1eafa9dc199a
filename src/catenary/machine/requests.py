"""Requests for a loop, made from the tables of a machine file and the devices found."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec import UNSET

from catenary.bus import SubDevice
from catenary.drive import Drives
from catenary.drive.modules import described
from catenary.drive.process_data import ProcessData
from catenary.machine.channels import make_channels
from catenary.machine.device_request import StartUpRequest, device_modules, start_up_objects
from catenary.machine.file import MachineFile
from catenary.machine.options import drives_options, process_data_options
from catenary.machine.references import AxisAddress, axis_addresses
from catenary.toml_lines import KeyPath

Subs = Mapping[str, SubDevice]  # present devices, by their names in the file


def devices_of(file: MachineFile, kind: str, role: str) -> list[str]:
    """Return the names of the devices of a role.

    Args:
        file: the machine file.
        kind: "drives" or "process_data".
        role: name of the drives or process data.
    """
    if kind == "process_data":
        return [file.tables.process_data[role].device]
    return list(dict.fromkeys(axis.device for axis in axis_addresses(file, role)))


def make_drives(file: MachineFile, role: str, subs: Subs) -> Drives:
    """Return the drives of [drives.ROLE].

    Args:
        file: the machine file.
        role: name of the drives.
        subs: present devices by name.

    Raises:
        MachineFileError: A slot does not exist, a device is not a drive, or an option is not valid.
    """
    path: KeyPath = ("drives", role)
    options = drives_options(file, role)
    addresses = axis_addresses(file, role)
    axes = [
        _axis(file, (*path, "axes", number), address, subs[address.device])
        for number, address in enumerate(addresses)
    ]
    options.setdefault("names", [str(address) for address in addresses])
    options.setdefault("required", _required(file, [address.device for address in addresses]))
    with file.located(path, options):
        return Drives(axes, **options)


def _axis(
    file: MachineFile, path: KeyPath, address: AxisAddress, sub: SubDevice
) -> tuple[SubDevice, int]:
    [number] = [k for k, each in enumerate(file.tables.device) if each.name == address.device]
    slots = described(sub, device_modules(file, number, sub)).slots or (0,)
    if address.slot is None and len(slots) == 1:
        return sub, slots[0]
    if address.slot in slots:
        return sub, address.slot
    known = ", ".join(f'"{address.device}/{slot}"' for slot in slots)
    if address.slot is None:
        raise file.error(path, f'"{address}" has {len(slots)} axes; write one of {known}')
    raise file.error(
        path, f'"{address}": {sub.station} has no axis in slot {address.slot}; its axes are {known}'
    )


def make_process_data(file: MachineFile, role: str, subs: Subs) -> ProcessData:
    """Return the process data of [process_data.ROLE].

    Args:
        file: the machine file.
        role: name of the process data.
        subs: present devices by name.

    Raises:
        MachineFileError: An object is not in a PDO of the device, or an option is not valid.
    """
    path: KeyPath = ("process_data", role)
    table = file.tables.process_data[role]
    sub = subs[table.device]
    options = process_data_options(file, role)
    [number] = [k for k, each in enumerate(file.tables.device) if each.name == table.device]
    device = described(sub, device_modules(file, number, sub))
    modules = file.tables.device[number].modules
    if modules is not UNSET:
        options["modules"] = modules
    for name in ("inputs", "outputs"):
        given = getattr(table, name)
        if given is not UNSET:
            options[name] = make_channels(file, (*path, name), given, device)
    options.setdefault("required", _required(file, [table.device]))
    with file.located(path, options):
        return ProcessData(sub, **options)


def make_device_requests(file: MachineFile, subs: Subs) -> list[StartUpRequest]:
    """Return requests for present devices with start-up objects or modules, or that may be absent.

    Args:
        file: the machine file.
        subs: present devices by name.
    """
    made = []
    for number, device in enumerate(file.tables.device):
        objects = start_up_objects(file, number)
        if device.name not in subs:
            continue
        modules = device_modules(file, number, subs[device.name])
        if device.required and not objects and modules is None:
            continue
        dividers = _dividers(file, device.name)
        made.append(
            StartUpRequest(
                subs[device.name],
                objects,
                modules,
                required=device.required and not dividers,  # a role has its own `required`
                divider=dividers[0] if dividers else 1,
            )
        )
    return made


def _dividers(file: MachineFile, device: str) -> list[int]:
    """Return the dividers of the roles that use a device."""
    roles = [
        (kind, role, table.divider)
        for kind, tables in (
            ("drives", file.tables.drives),
            ("process_data", file.tables.process_data),
        )
        for role, table in tables.items()
    ]
    return [
        1 if divider is UNSET else divider
        for kind, role, divider in roles
        if device in devices_of(file, kind, role)
    ]


def _required(file: MachineFile, names: list[str]) -> bool:
    return all(device.required for device in file.tables.device if device.name in names)

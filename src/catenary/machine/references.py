"""Checks of the names, addresses and list lengths in a machine file, without any devices."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from typing import NamedTuple

from msgspec import UNSET

from catenary.machine.file import MachineFile
from catenary.machine.schema import DrivesTable, ProcessDataTable
from catenary.toml_lines import KeyPath
from catenary.types import ALL, DataType, Value, by_name

SLOTS_END = 8  # ETG.6010 §5.1: 0x6000 + 0x800 · slot, at most 0x9FFF
_OBJECT = re.compile(r"0x([0-9A-Fa-f]{4}):([0-9A-Fa-f]{1,2})")
# Lists that do not have one value per axis.
WHOLE_LISTS = ("other_modes", "measured", "columns", "pdos", "axes")

COPY_DEVICES = {"copy": ("source", "destination"), "fsoe": ("main", "sub")}


class AxisAddress(NamedTuple):
    """Address of an axis in the file."""

    device: str  # name of the device
    slot: int | None  # None if the file gives no slot; the device then has a single axis

    def __str__(self) -> str:
        return self.device if self.slot is None else f"{self.device}/{self.slot}"


def check_references(file: MachineFile) -> None:
    """Check names, addresses and lists, which the schema cannot check.

    Raises:
        MachineFileError: A name, an address or a list contradicts the rest of the file.
    """
    _check_devices(file)
    _check_axes(file)
    for name, table in file.tables.drives.items():
        _check_lists(file, name, table)
    for name, data in file.tables.process_data.items():
        _check_process_data(file, ("process_data", name), data)
    for kind, keys in COPY_DEVICES.items():
        for number, table in enumerate(getattr(file.tables, kind)):
            for key in keys:
                check_device(file, (kind, number, key), getattr(table, key))
    _check_op_modes(file)
    reference = file.tables.clocks.reference
    if reference is not UNSET:
        check_device(file, ("clocks", "reference"), reference)


def check_device(file: MachineFile, path: KeyPath, name: str) -> None:
    """Raise MachineFileError if no device of the file has a name.

    Args:
        file: the machine file.
        path: path of the key with the name.
        name: the name.
    """
    names = [device.name for device in file.tables.device]
    if name not in names:
        raise file.error(path, f'no device is named "{name}"{nearest(name, names)}')


def nearest(name: str, names: Sequence[str]) -> str:
    """Return the end of a message about an unknown name: the nearest name, or all names if any.

    Args:
        name: the unknown name.
        names: known names.
    """
    near = get_close_matches(name, names, n=1)
    if near:
        return f'; did you mean "{near[0]}"?'
    return f"; known names are {', '.join(names)}" if names else ""


def _check_devices(file: MachineFile) -> None:
    seen: dict[tuple[str, str | int], int] = {}
    for number, device in enumerate(file.tables.device):
        path: KeyPath = ("device", number)
        if "/" in device.name:
            raise file.error((*path, "name"), f'the name "{device.name}" must not contain "/"')
        if device.alias is UNSET and device.position is UNSET:
            raise file.error(
                path,
                f'device "{device.name}" has neither alias nor position',
                hint="write, for example, alias = 10 or position = 3; see `catenary scan`",
            )
        if device.alias is not UNSET and device.position is not UNSET:
            raise file.error(
                (*path, "position"),
                f'device "{device.name}" has both alias and position',
                hint="keep the alias; it stays valid when the device moves to another position",
            )
        for key in ("name", "alias", "position"):
            value = getattr(device, key)
            if value is UNSET:
                continue
            first = seen.setdefault((key, value), number)
            if first != number:
                other = f'device[{first}], "{file.tables.device[first].name}"'
                shown = f'"{value}"' if key == "name" else value
                raise file.error((*path, key), f"{key} {shown} is already used by {other}")


def axis_addresses(file: MachineFile, role: str) -> list[AxisAddress]:
    """Return the axes of [drives.ROLE].

    Args:
        file: the machine file.
        role: name of the drives.

    Raises:
        MachineFileError: An axis does not name a device of the file, or its slot is out of range.
    """
    found = []
    for number, text in enumerate(file.tables.drives[role].axes):
        path: KeyPath = ("drives", role, "axes", number)
        device, slash, slot = text.partition("/")
        check_device(file, path, device)
        if slash and not (slot.isdecimal() and int(slot) < SLOTS_END):
            raise file.error(
                path, f'"{text}": the slot after the "/" must be a number from 0 to {SLOTS_END - 1}'
            )
        found.append(AxisAddress(device, int(slot) if slash else None))
    return found


def _check_axes(file: MachineFile) -> None:
    """Check that the lists of axes are not empty and that each axis is used only once."""
    owners: dict[AxisAddress, str] = {}
    for role, table in file.tables.drives.items():
        if not table.axes:
            raise file.error(("drives", role, "axes"), "the list of axes is empty")
        for number, axis in enumerate(axis_addresses(file, role)):
            path = ("drives", role, "axes", number)
            same = AxisAddress(axis.device, None if axis.slot == 0 else axis.slot)
            if same in owners:
                where = "twice" if owners[same] == role else f"in [drives.{owners[same]}] too"
                raise file.error(path, f'axis "{axis}" is used {where}')
            owners[same] = role


def _check_lists(file: MachineFile, role: str, table: DrivesTable) -> None:
    path: KeyPath = ("drives", role)
    for key in table.__struct_fields__:
        value = getattr(table, key)
        if key not in WHOLE_LISTS and isinstance(value, list) and len(value) != len(table.axes):
            raise file.error(
                (*path, key),
                f"{len(value)} values for {len(table.axes)} axes",
                hint="write one value per axis in the order of `axes`, or a single value for all",
            )
    names = [] if table.names is UNSET else table.names
    for number, name in enumerate(names):
        if name in names[:number]:
            raise file.error((*path, "names", number), f'two axes are named "{name}"')


def _check_process_data(file: MachineFile, path: KeyPath, table: ProcessDataTable) -> None:
    check_device(file, (*path, "device"), table.device)
    inputs = {} if table.inputs is UNSET else table.inputs
    outputs = {} if table.outputs is UNSET else table.outputs
    for name in outputs:
        if name in inputs:
            raise file.error(
                (*path, "outputs", name), f'"{name}" is the name of both an input and an output'
            )
    if table.outputs is not UNSET:  # otherwise the device defines the names
        for name in table.safe:
            if name not in outputs:
                text = f'"{name}" is not an output{nearest(name, list(outputs))}'
                raise file.error((*path, "safe", name), text)
    known = [*inputs, *outputs]
    for pdo, names in table.pdos.items() if isinstance(table.pdos, dict) else ():
        pdo_index(file, (*path, "pdos", pdo), pdo)
        for number, name in enumerate(names):
            if name not in known:
                text = f'"{name}" is not an input or output{nearest(name, known)}'
                raise file.error((*path, "pdos", pdo, number), text)


def _check_op_modes(file: MachineFile) -> None:
    """Check that a role uses the device of every `op_mode`."""
    used = {table.device for table in file.tables.process_data.values()}
    used |= {axis.device for role in file.tables.drives for axis in axis_addresses(file, role)}
    for number, device in enumerate(file.tables.device):
        if device.op_mode is not UNSET and device.name not in used:
            raise file.error(
                ("device", number, "op_mode"),
                f'op_mode has no effect, because no drives or process data use "{device.name}"',
                hint=f'add [process_data.NAME] with device = "{device.name}", or remove op_mode',
            )


def pdo_index(file: MachineFile, path: KeyPath, text: str) -> int:
    """Return the index of a PDO from a key such as "0x1A00".

    Args:
        file: the machine file.
        path: path of the key.
        text: the key.

    Raises:
        MachineFileError: The text is not the index of a PDO.
    """
    if re.fullmatch(r"0x1[6-9A-Ba-b][0-9A-Fa-f]{2}", text) is None:
        raise file.error(path, f'"{text}" is not a PDO; expected "0x1600" to "0x1BFF"')
    return int(text, 16)


def object_of(file: MachineFile, path: KeyPath, text: str) -> tuple[int, int]:
    """Return index and subindex of an object from text such as "0x6000:11", both hexadecimal.

    Args:
        file: the machine file.
        path: path of the key with the object.
        text: the object.

    Raises:
        MachineFileError: The text is not an object.
    """
    found = _OBJECT.fullmatch(text)
    if found is None:
        raise file.error(
            path,
            f'"{text}" is not an object; expected "0xINDEX:SUBINDEX", both hexadecimal',
            hint='write four digits for the index and one or two for the subindex: "0x6000:11"',
        )
    return int(found[1], 16), int(found[2], 16)


def data_type(file: MachineFile, path: KeyPath, text: str) -> DataType[Value]:
    """Return the data type of a name such as "UINT" or "UNSIGNED16".

    Args:
        file: the machine file.
        path: path of the key with the name.
        text: the name.

    Raises:
        MachineFileError: The name is unknown.
    """
    try:
        return by_name(text)
    except ValueError:
        names = [name for kind in ALL for name in (kind.name, *kind.aliases)]
        known = nearest(text.upper(), names) if get_close_matches(text.upper(), names) else ""
        hint = "use BOOL, SINT, INT, DINT, LINT, USINT, UINT, UDINT, ULINT, REAL, LREAL, ..."
        raise file.error(path, f'"{text}" is not a data type{known}', hint=hint) from None

"""Channels from the tables [process_data.NAME], and columns from [drives.NAME]."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import cast

from msgspec import UNSET

from catenary.drive.arguments import named_columns
from catenary.drive.channel import Channel, NumberType, channel_of
from catenary.machine.file import MachineFile
from catenary.machine.references import data_type, nearest, object_of
from catenary.machine.schema import ChannelTable, ColumnTable
from catenary.model.device import DeviceDescription, Direction, Entry
from catenary.toml_lines import KeyPath

UNTYPED = Entry(1, 0, 1)  # placeholder where the type of the entry is not used
Given = Mapping[str, str | ChannelTable]


def check_channels(file: MachineFile, path: KeyPath, given: Given) -> None:
    """Check the objects, types and scales of a table of channels.

    Args:
        file: the machine file.
        path: key path of the table.
        given: channels by name.

    Raises:
        MachineFileError: An object, a type or a scale is not valid.
    """
    for name, spec in given.items():
        _channel(file, (*path, name), spec, UNTYPED)


def make_channels(
    file: MachineFile, path: KeyPath, given: Given, device: DeviceDescription
) -> dict[str, Channel]:
    """Return the channels of a table by name.

    The PDOs of the device supply the types that the file does not give.

    Args:
        file: the machine file.
        path: key path of the table.
        given: channels by name.
        device: description of the device.

    Raises:
        MachineFileError: An object, a type or a scale is not valid, or an object without a type is
            not in a PDO of the device.
    """
    direction = Direction.INPUT if path[-1] == "inputs" else Direction.OUTPUT
    return {
        name: _channel(
            file, (*path, name), spec, _entry(file, (*path, name), spec, device, direction)
        )
        for name, spec in given.items()
    }


def make_columns(
    file: MachineFile, path: KeyPath, given: Sequence[str | ColumnTable]
) -> list[str | tuple[str, Channel]]:
    """Return the option `columns` of `Drives`.

    Args:
        file: the machine file.
        path: key path of the list.
        given: columns of the list.

    Raises:
        MachineFileError: A name is unknown, or an object or a type is not valid.
    """
    columns: list[str | tuple[str, Channel]] = []
    for number, spec in enumerate(given):
        place = (*path, number)
        with file.located(place):
            column = spec if isinstance(spec, str) else _column(file, place, spec)
            named_columns([column])
        columns.append(column)
    return columns


def _column(file: MachineFile, path: KeyPath, table: ColumnTable) -> tuple[str, Channel]:
    channel = ChannelTable(object=table.object, type=table.type, scale=table.scale, unit=table.unit)
    return table.name, replace(_channel(file, path, channel, UNTYPED), output=table.output)


def _channel(file: MachineFile, path: KeyPath, spec: str | ChannelTable, entry: Entry) -> Channel:
    table = ChannelTable(object=spec) if isinstance(spec, str) else spec
    place = path if isinstance(spec, str) else (*path, "object")
    index, subindex = object_of(file, place, table.object)
    kind = channel_of(entry).type
    if table.type is not UNSET:
        kind = cast(NumberType, data_type(file, (*path, "type"), table.type))
    scale = None if table.scale is UNSET else table.scale
    with file.located(path, () if isinstance(spec, str) else ("type", "scale")):
        return Channel(index, subindex, kind, scale, unit=table.unit)


def _entry(
    file: MachineFile,
    path: KeyPath,
    spec: str | ChannelTable,
    device: DeviceDescription,
    direction: Direction,
) -> Entry:
    """Return the PDO entry that supplies the type of an object; UNTYPED if the file gives the type.

    Raises:
        MachineFileError: The object has no type in the file and is not in a PDO of the device.
    """
    if isinstance(spec, ChannelTable) and spec.type is not UNSET:
        return UNTYPED
    text = spec if isinstance(spec, str) else spec.object
    place = object_of(file, path, text)
    entries = [entry for pdo in device.pdos(direction) for entry in pdo.entries if entry.index]
    for entry in entries:
        if (entry.index, entry.subindex) == place:
            return entry
    known = [f"0x{entry.index:04X}:{entry.subindex:02X}" for entry in entries]
    raise file.error(
        path,
        f"{text} is not in a PDO of {device}{nearest(text, known)}",
        hint=f'if the device has this object, add its type: {{ object = "{text}", type = "UINT" }}',
    )

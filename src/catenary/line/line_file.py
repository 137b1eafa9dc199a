"""line.toml: the devices of a clone in order, with their folders and the topology."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from catenary.line.fields import FORMAT, Document, Fields
from catenary.line.toml_text import flag, listed, quoted
from catenary.line.values import ClonedDevice, Line

DEVICES_MAX = 0xFFFF
FOLDER_NAME_MAX = 40
FOLDER = re.compile(rf"[0-9]{{2,5}}-[A-Za-z0-9_][A-Za-z0-9._-]{{0,{FOLDER_NAME_MAX - 1}}}")
_IDENTITY = ("vendor", "product", "revision", "serial")
_DEVICE = ("name", "folder", "station", "alias", *_IDENTITY, "parent", "parent_port", "complete")


class DeviceEntry(NamedTuple):
    """One device in a line file."""

    name: str
    folder: str
    complete: bool


class LineFile(NamedTuple):
    """Content of a line file."""

    entries: tuple[DeviceEntry, ...]
    complete: bool
    serials: bool
    notes: tuple[str, ...]


def folder_name(position: int, name: str) -> str:
    """Return the name of a device's folder, such as "01-EK1100".

    Args:
        position: Position of the device; the number of its folder is one greater.
        name: Name of the device.
    """
    plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name)[:FOLDER_NAME_MAX].lstrip(".-")
    return f"{position + 1:02d}-{plain or 'unknown'}"


def line_text(line: Line) -> str:
    """Return the text of a line file."""
    return "\n".join(
        (
            "# Clone of a segment, written by `catenary clone`. Each device has a folder.",
            f"format = {FORMAT}",
            f"complete = {flag(line.complete)}",
            f"serials = {flag(line.serials)}",
            f"notes = {listed(line.notes)}",
            *(text for device in line.devices for text in _device_lines(device)),
            "",
        )
    )


def _device_lines(device: ClonedDevice) -> Iterator[str]:
    yield f"\n[[device]]  # position {device.position}"
    yield f"name = {quoted(device.name)}"
    yield f"folder = {quoted(folder_name(device.position, device.name))}"
    yield f"complete = {flag(device.complete)}"
    yield f"station = 0x{device.station_address:04X}"
    yield f"alias = 0x{device.alias:04X}"
    if device.identity is not None:
        for key, number in zip(_IDENTITY, device.identity, strict=True):
            yield f"{key} = 0x{number:08X}"
    if device.parent is not None:
        yield f"parent = {device.parent}"
        yield f"parent_port = {device.parent_port}"


def parse_line(text: str, file: str) -> LineFile:
    """Return the content of a line file.

    Args:
        text: The text.
        file: Name of the file, for errors.

    Raises:
        CloneError: The text is not valid.
    """
    root = Document(file, text).root()
    root.only(("format", "complete", "serials", "notes", "device"))
    entries: list[DeviceEntry] = []
    for table in root.tables("device"):
        entries.append(_entry(table, entries))
    if not 0 < len(entries) <= DEVICES_MAX:
        raise root.error("device", f"{len(entries)} devices (1 to {DEVICES_MAX})")
    complete = root.flag("complete")
    if complete != all(each.complete for each in entries):
        raise root.error(
            "complete", "complete must be true if all devices are complete, else false"
        )
    return LineFile(tuple(entries), complete, root.flag("serials"), root.texts("notes"))


def _entry(table: Fields, before: Sequence[DeviceEntry]) -> DeviceEntry:
    """Return one device. Its numbers are those of its device file, and are compared later."""
    table.only(_DEVICE)
    folder = table.text("folder")
    if not FOLDER.fullmatch(folder):
        raise table.error("folder", f"{folder!r} is not a folder of a device, such as 01-EK1100")
    if int(folder.partition("-")[0]) != len(before) + 1:
        raise table.error("folder", f"{folder!r} must begin with {len(before) + 1:02d}")
    return DeviceEntry(table.text("name"), folder, table.flag("complete"))


def disagreement(text: str, file: str, devices: Sequence[ClonedDevice]) -> None:
    """Compare a line file with the devices in its folders.

    Args:
        text: Text of the line file.
        file: Its name, for errors.
        devices: The devices, by position.

    Raises:
        CloneError: A number or a name differs.
    """
    tables = Document(file, text).root().tables("device")
    for table, device in zip(tables, devices, strict=True):
        folder = table.text("folder")
        for key, expected in _facts(device).items():
            if expected is None:
                if key in table:
                    raise table.error(key, f"{key} is not in {folder}/device.toml")
            elif isinstance(expected, str):
                if table.text(key) != expected:
                    raise table.error(key, f'{key} differs: "{expected}" in {folder}/device.toml')
            elif table.number(key, 0, 0xFFFF_FFFF) != expected:
                raise table.error(key, f"{key} differs: 0x{expected:X} in {folder}/device.toml")


def _facts(device: ClonedDevice) -> dict[str, int | str | None]:
    identity = device.identity
    return {
        "name": device.name,
        "station": device.station_address,
        "alias": device.alias,
        **{key: getattr(identity, key, None) for key in _IDENTITY},
        "parent": device.parent,
        "parent_port": device.parent_port,
    }

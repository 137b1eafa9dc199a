"""Reader of a clone folder. It checks every file; errors name the file and the line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from catenary.errors import CloneError
from catenary.line.device_file import parse_device
from catenary.line.files import (
    AGAIN,
    DEVICE_FILE,
    LINE_FILE,
    OBJECTS_FILE,
    SII_FILE,
    check_folder,
    read_bytes,
    read_text,
)
from catenary.line.line_file import FOLDER, DeviceEntry, disagreement, folder_name, parse_line
from catenary.line.object_file import parse_objects
from catenary.line.values import ClonedDevice, Line


def read_line(folder: str | Path) -> Line:
    """Read a clone folder.

    A folder with missing parts is read, too: `Line.complete` is then False. A folder without
    `line.toml` is not: its clone was interrupted.

    Args:
        folder: The folder that `catenary clone` has written.

    Raises:
        CloneError: A file is missing or not valid, or two files contradict each other.
    """
    where = Path(folder)
    if not where.is_dir():  # the folder itself may be a link
        check_folder(where)
    path = where / LINE_FILE
    if not path.exists() and not path.is_symlink():
        hint = "run `catenary clone TARGET -o FOLDER` again: it continues an interrupted clone"
        raise CloneError("the file is missing: not a finished clone", file=str(path), hint=hint)
    text = read_text(path)
    content = parse_line(text, str(path))
    devices = [_member(where, position, each) for position, each in enumerate(content.entries)]
    disagreement(text, str(path), devices)
    return Line(tuple(devices), content.serials, content.notes)


def _member(folder: Path, position: int, entry: DeviceEntry) -> ClonedDevice:
    device = read_device(folder / entry.folder)
    file = str(folder / entry.folder / DEVICE_FILE)
    if device.position != position:
        message = f"position = {device.position}, but {LINE_FILE} has it at {position}"
        raise CloneError(message, file=file, hint=AGAIN)
    if folder_name(position, device.name) != entry.folder:
        raise CloneError(f"the name {device.name!r} does not fit its folder", file=file, hint=AGAIN)
    if device.complete != entry.complete:
        message = f"complete differs from {LINE_FILE}"
        raise CloneError(message, file=file, hint=AGAIN)
    return device


def read_device(folder: str | Path) -> ClonedDevice:
    """Read the folder of one device.

    Args:
        folder: The folder, such as line/01-EK1100.

    Raises:
        CloneError: A file is missing or not valid.
    """
    where = Path(folder)
    check_folder(where)
    path = where / DEVICE_FILE
    device = parse_device(read_text(path), str(path))
    sii, objects = where / SII_FILE, where / OBJECTS_FILE
    if _is_there(sii):
        device = replace(device, sii=read_bytes(sii))
    if _is_there(objects):
        device = replace(device, objects=parse_objects(read_text(objects), str(objects)))
    _check_parts(device, path)
    return device


def _check_parts(device: ClonedDevice, path: Path) -> None:
    """Check that each part is there or explained."""
    if device.sii is None and "sii" not in device.missing:
        raise CloneError(f"{SII_FILE} is missing, without a reason", file=str(path), hint=AGAIN)
    coe = device.mailbox is not None and device.mailbox.coe
    if coe and not device.objects and "objects" not in device.missing:
        raise CloneError(f"{OBJECTS_FILE} is missing, without a reason", file=str(path), hint=AGAIN)


def _is_there(path: Path) -> bool:
    return path.exists() or path.is_symlink()


def kept_device(folder: Path, position: int) -> ClonedDevice | None:
    """Return a finished device of an interrupted clone; None if the folder does not have it.

    Args:
        folder: The folder of the clone.
        position: Position of the device.

    Raises:
        CloneError: A file of the device is not valid.
    """
    for each in sorted(folder.glob(f"{position + 1:02d}-*")):
        if FOLDER.fullmatch(each.name):
            device = read_device(each)
            if folder_name(position, device.name) == each.name and device.position == position:
                return device
    return None

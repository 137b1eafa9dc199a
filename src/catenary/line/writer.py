"""Writer of a clone folder. Each device is written under a temporary name and renamed."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Collection
from pathlib import Path

from catenary.errors import CloneError
from catenary.line.device_file import device_text
from catenary.line.files import (
    DEVICE_FILE,
    LIMITS,
    LINE_FILE,
    OBJECTS_FILE,
    PARTIAL,
    SII_FILE,
    check_folder,
    read_text,
)
from catenary.line.line_file import FOLDER, folder_name, line_text, parse_line
from catenary.line.object_file import objects_text
from catenary.line.values import ClonedDevice, Line

_OWN = re.compile(rf"({FOLDER.pattern})({re.escape(PARTIAL)})?")
_FILES = {DEVICE_FILE, SII_FILE, OBJECTS_FILE}


def write_line(line: Line, folder: str | Path) -> None:
    """Write a clone folder: all devices, then `line.toml`.

    Args:
        line: The clone.
        folder: The folder. It is made if it does not exist; a clone in it is replaced.

    Raises:
        CloneError: The folder contains other files.
        OSError: A file cannot be written.
    """
    where = prepare(folder)
    for device in line.devices:
        write_device(device, where)
    finish(line, where)


def prepare(folder: str | Path) -> Path:
    """Make the folder of a clone, or check an existing one. Rename its `line.toml`.

    An interrupted clone thus differs from a complete one that is read again (`is_complete`).

    Args:
        folder: The folder.

    Raises:
        CloneError: The folder is not empty and contains other files than a clone.
    """
    where = Path(folder)
    where.mkdir(parents=True, exist_ok=True)
    other = sorted(each.name for each in where.iterdir() if not _is_own(each))
    if other:
        raise CloneError(
            f"the folder contains other files than a clone: {other[0]}",
            file=str(where),
            hint="name a new folder with -o",
        )
    if (where / LINE_FILE).exists():
        (where / LINE_FILE).replace(where / (LINE_FILE + PARTIAL))
    return where


def is_complete(folder: Path) -> bool:
    """Return True if a prepared folder had a complete clone.

    Args:
        folder: The folder, after `prepare`.
    """
    path = folder / (LINE_FILE + PARTIAL)
    try:
        return parse_line(read_text(path), str(path)).complete
    except CloneError:  # missing, half written, or edited
        return False


def write_device(device: ClonedDevice, folder: Path) -> Path:
    """Write the folder of one device, and return it.

    Args:
        device: The device.
        folder: The folder of the clone.

    Raises:
        CloneError: A part is larger than the reader accepts.
        OSError: A file cannot be written.
    """
    final = folder / folder_name(device.position, device.name)
    partial = final.with_name(final.name + PARTIAL)
    _remove(partial)
    partial.mkdir()
    _write(partial / DEVICE_FILE, device_text(device).encode())
    if device.sii is not None:
        _write(partial / SII_FILE, device.sii)
    if device.objects:
        _write(partial / OBJECTS_FILE, objects_text(device.objects).encode())
    _remove(final)
    partial.rename(final)
    return final


def finish(line: Line, folder: Path) -> None:
    """Write `line.toml`, and remove the folders of devices that are not in the clone.

    Args:
        line: The clone.
        folder: Its folder.
    """
    wanted = {folder_name(device.position, device.name) for device in line.devices}
    remove_others(folder, wanted)
    partial = folder / (LINE_FILE + PARTIAL)
    _write(partial, line_text(line).encode())
    partial.replace(folder / LINE_FILE)


def remove_others(folder: Path, wanted: Collection[str]) -> None:
    """Remove the device folders of an earlier clone.

    Args:
        folder: The folder of the clone.
        wanted: Names of the folders to keep.
    """
    for each in folder.iterdir():
        if _OWN.fullmatch(each.name) and each.name not in wanted:
            _remove(each)


def _is_own(path: Path) -> bool:
    """Return True for the files of a clone, whole or partial."""
    if path.name in (LINE_FILE, LINE_FILE + PARTIAL):
        return not path.is_symlink() and path.is_file()
    if not _OWN.fullmatch(path.name) or path.is_symlink() or not path.is_dir():
        return False
    return all(each.name in _FILES and each.is_file() for each in path.iterdir())


def _remove(path: Path) -> None:
    if path.is_symlink() or path.exists():
        check_folder(path)
        shutil.rmtree(path)


def _write(path: Path, data: bytes) -> None:
    limit = LIMITS[path.name.removesuffix(PARTIAL)]
    if len(data) > limit:
        raise CloneError(f"{len(data)} bytes, the limit is {limit}", file=str(path))
    with open(path, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())

"""Bounded reading of the files of a clone folder. Links and special files are refused."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from catenary.errors import CloneError
from catenary.wire.sii import MAXIMUM_SIZE

LINE_FILE, DEVICE_FILE, SII_FILE, OBJECTS_FILE = (
    "line.toml",
    "device.toml",
    "sii.bin",
    "objects.tsv",
)
PARTIAL = ".partial"
LIMITS = {  # bytes
    LINE_FILE: 16 << 20,
    DEVICE_FILE: 4 << 20,
    SII_FILE: MAXIMUM_SIZE,
    OBJECTS_FILE: 64 << 20,
}
AGAIN = "clone the segment again: catenary clone TARGET -o FOLDER"


def read_bytes(path: Path) -> bytes:
    """Read a file of a clone folder. Its name determines the largest size.

    Raises:
        CloneError: The file is missing, too large, not a regular file, or a symbolic link.
    """
    try:
        # O_NONBLOCK: opening a named pipe must not wait for its writer
        opened = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise unreadable(path, error) from error
    with open(opened, "rb") as file:
        if not stat.S_ISREG(os.fstat(opened).st_mode):
            raise CloneError("not a regular file", file=str(path), hint=AGAIN)
        limit = LIMITS[path.name.removesuffix(PARTIAL)]
        try:
            data = file.read(limit + 1)
        except OSError as error:
            raise unreadable(path, error) from error
    if len(data) > limit:
        raise CloneError(f"more than {limit} bytes", file=str(path), hint=AGAIN)
    return data


def read_text(path: Path) -> str:
    """Read a text file of a clone folder.

    Raises:
        CloneError: As `read_bytes`, or the file is not UTF-8.
    """
    data = read_bytes(path)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        message = f"not UTF-8 text: byte 0x{data[error.start]:02X}"
        raise CloneError(message, file=str(path), line=line, hint="save it as UTF-8") from error


def check_folder(path: Path) -> None:
    """Check that a path is a folder and not a symbolic link.

    Raises:
        CloneError: It is not.
    """
    try:
        mode = path.lstat().st_mode
    except OSError as error:
        raise unreadable(path, error) from error
    if stat.S_ISLNK(mode):
        raise _link(path)
    if not stat.S_ISDIR(mode):
        raise CloneError("not a folder", file=str(path), hint=AGAIN)


def unreadable(path: Path, error: OSError) -> CloneError:
    """Return the error for a file that the operating system does not open.

    Args:
        path: The file.
        error: The error of the system.
    """
    if error.errno == errno.ELOOP:
        return _link(path)
    return CloneError(error.strerror or str(error), file=str(path), hint=AGAIN)


def _link(path: Path) -> CloneError:
    return CloneError(
        "a symbolic link; a clone contains only files and folders",
        file=str(path),
        hint="copy the file to its place",
    )

"""Paths in ESI files: `InfoReference` and `DictionaryFile`, relative to the file that has them."""

from __future__ import annotations

import os
import re
from pathlib import Path

MAX_PARTS = 64  # of a path
ABSOLUTE = re.compile(r"[/\\]|[A-Za-z]:")


def parts_of(target: str) -> list[str] | None:
    """Return the parts of a relative path; None if it is absolute, empty or too long."""
    text = target.strip()
    if not text or "\0" in text or ABSOLUTE.match(text):
        return None
    parts = [part for part in text.replace("\\", "/").split("/") if part not in ("", ".")]
    return parts if 0 < len(parts) <= MAX_PARTS else None


def resolve(target: str, file: Path, root: Path) -> Path | None:
    """Return the file that a path in an ESI file names; None if `root` does not have it.

    Backslashes separate folders. Upper and lower case are equal unless an exact match exists,
    because the files were written for Windows.

    Args:
        target: The path in the file.
        file: The file that contains it.
        root: Folder that the result cannot leave, not even through a symbolic link.
    """
    place = file.parent
    for part in parts_of(target) or ("",):
        step = place.parent if part == ".." else _child(place, part)
        if step is None or not inside(step, root):
            return None
        place = step
    return place if place.is_file() else None


def inside(path: Path, root: Path) -> bool:
    """Return True if `path` is in `root`, after symbolic links.

    Args:
        path: Path of a file or folder.
        root: Path of a folder.
    """
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(root))


def _child(folder: Path, name: str) -> Path | None:
    if not name:
        return None
    try:
        names = sorted(os.listdir(folder))
    except OSError:  # a missing folder: the caller reports the reference
        return None
    if name in names:
        return folder / name
    same = [each for each in names if each.casefold() == name.casefold()]
    return folder / same[0] if same else None

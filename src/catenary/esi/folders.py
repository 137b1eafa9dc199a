"""Folders of the user for libraries of ESI files and their indexes."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "CATENARY_ESI"
SMALL = 4 << 20  # [bytes]; XML files of this size are indexed in 0.2 s
MANY = 1000  # folders


def default_folder() -> Path:
    """Return the folder of the user's library."""
    given = os.environ.get(VARIABLE)
    if given:
        return Path(os.path.abspath(os.path.expanduser(given)))
    return _user_folder("XDG_DATA_HOME", ".local/share") / "catenary" / "esi"


def _user_folder(variable: str, fallback: str) -> Path:
    """Return a folder of the XDG base directory specification. Relative paths are ignored."""
    given = os.environ.get(variable, "")
    return Path(given) if os.path.isabs(given) else Path.home() / fallback


def cache_folder() -> Path | None:
    """Return the folder for indexes of temporary libraries; None if it cannot be created."""
    folder = _user_folder("XDG_CACHE_HOME", ".cache") / "catenary" / "esi"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:  # the index is then made in memory
        return None
    return folder


def is_small(path: Path) -> bool:
    """Return True if the XML files of a file or folder are indexed quickly."""
    if path.is_file():
        return path.stat().st_size <= SMALL
    total = 0
    for count, (place, _folders, names) in enumerate(os.walk(path)):
        files = (os.path.join(place, each) for each in names if each.lower().endswith(".xml"))
        total += sum(_size(each) for each in files)
        if total > SMALL or count > MANY:
            return False
    return True


def _size(path: str) -> int:
    return os.stat(path).st_size if os.path.isfile(path) else 0

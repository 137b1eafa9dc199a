"""Folder of the user's ESI library. This module imports neither sqlite nor a parser."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "CATENARY_ESI"


def default_folder() -> Path:
    """Return the folder of the user's library."""
    given = os.environ.get(VARIABLE)
    if given:
        return Path(os.path.abspath(os.path.expanduser(given)))
    return user_folder("XDG_DATA_HOME", ".local/share") / "catenary" / "esi"


def user_folder(variable: str, fallback: str) -> Path:
    """Return a folder of the XDG base directory specification; it ignores relative paths.

    Args:
        variable: Environment variable of the folder.
        fallback: Folder in the user's home if the variable is not set.
    """
    given = os.environ.get(variable, "")
    return Path(given) if os.path.isabs(given) else Path.home() / fallback

"""Location of catenary_share.h, the interface for C, C++ and C#."""

from __future__ import annotations

from pathlib import Path


def include_folder() -> str:
    """Return the folder of `catenary_share.h` and `catenary_share.c`, for a compiler's `-I`."""
    return str(Path(__file__).resolve().parent.parent / "include")

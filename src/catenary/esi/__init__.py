"""EtherCAT SubDevice Information (ESI, ETG.2000): vendors' device description files.

The names below are loaded when they are first used, because a scan without ESI files needs neither
the parser nor the index.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.esi.apply import applied
    from catenary.esi.library import Library
    from catenary.esi.reader import read_device, read_esi, read_module

__all__ = ["Library", "applied", "read_device", "read_esi", "read_module"]

_HOMES = {
    "Library": "catenary.esi.library",
    "applied": "catenary.esi.apply",
    "read_device": "catenary.esi.reader",
    "read_esi": "catenary.esi.reader",
    "read_module": "catenary.esi.reader",
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
    return getattr(import_module(_HOMES[name]), name)

"""Values of Catenary as values that JSON can represent."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum, IntFlag
from pathlib import Path


def plain(value: object) -> object:
    """Return a value for JSON.

    Dataclasses become objects, and enumerations names in lower case. Flags become lists of names;
    bits without a name become a number as text. Bytes become hexadecimal digits. NaN and infinity
    become None.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, IntFlag):
        return _names(value)
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, bytes):
        return value.hex()
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [plain(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def _names(flags: IntFlag) -> list[str]:
    named = [each for each in type(flags) if each in flags]
    rest = int(flags) & ~sum(map(int, named))
    return [str(each.name).lower() for each in named] + [f"0x{rest:X}"] * bool(rest)

"""Something that happened beside the cycle."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec


class Event(msgspec.Struct, frozen=True):
    serial: int
    number: int
    kind: str
    message: str
    time: float
    position: int | None = None
    details: Mapping[str, object] = {}

"""Base class of the process-data requests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

from catenary.bus import SubDevice
from catenary.drive.attributes import check_writable, unknown_attribute


class Request:
    """Owner of the devices of a process-data request.

    Access to an unknown attribute raises AttributeError with the nearest name.
    """

    def __init__(self, subs: Sequence[SubDevice]) -> None:
        for sub in subs:
            if not hasattr(sub, "position"):
                kind = type(self).__name__
                raise TypeError(f"{kind} takes SubDevices, such as subs[1]; not {sub!r}")
        self._subs = tuple(subs)

    def __getattr__(self, name: str) -> NoReturn:
        raise unknown_attribute(self, name)  # Python calls this only for an unknown attribute

    def __setattr__(self, name: str, value: object) -> None:
        check_writable(self, name)
        object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        names = dict.fromkeys(f"{sub.position} {sub.name}" for sub in self._subs)
        return f"{type(self).__name__}({', '.join(names)})"

    @property
    def subs(self) -> tuple[SubDevice, ...]:
        """Devices of the request. For `Drives`, the device of each axis."""
        return self._subs

"""SubDevices: all devices of a segment, by position, by kind, by alias."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import takewhile
from typing import overload

from catenary.bus.sub_device import SubDevice
from catenary.errors import SegmentError


class SubDevices(Sequence[SubDevice]):
    """The devices of a segment, by position."""

    def __init__(self, subs: Sequence[SubDevice] = ()) -> None:
        self._subs = tuple(subs)

    @property
    def drives(self) -> tuple[SubDevice, ...]:
        """Those with CiA 402 axes."""
        return tuple(sub for sub in self._subs if sub.is_drive)

    def group(self, alias: int) -> tuple[SubDevice, ...]:
        """The device with this station alias and those behind it up to the next one that has an
        alias of its own: a tool, wherever it is plugged in. Empty where nobody has it. SegmentError
        where several have; ValueError for 0, which is none."""
        if not 1 <= alias <= 0xFFFF:
            raise ValueError(f"alias {alias}: from 1 to 65535; 0 is none")
        heads = [sub.position for sub in self._subs if sub.alias == alias]
        if len(heads) > 1:
            raise SegmentError(
                f"devices {', '.join(map(str, heads))} have the same alias {alias}",
                hint="give each one its own: catenary alias TARGET POSITION VALUE",
            )
        if not heads:
            return ()
        behind = self._subs[heads[0] + 1 :]
        return (self._subs[heads[0]], *takewhile(lambda sub: not sub.alias, behind))

    @overload
    def __getitem__(self, position: int) -> SubDevice: ...
    @overload
    def __getitem__(self, position: slice) -> tuple[SubDevice, ...]: ...
    def __getitem__(self, position: int | slice) -> SubDevice | tuple[SubDevice, ...]:
        return self._subs[position]

    def __len__(self) -> int:
        return len(self._subs)

    def __iter__(self) -> Iterator[SubDevice]:
        return iter(self._subs)

    def __repr__(self) -> str:
        return f"<{len(self._subs)} SubDevices: {', '.join(sub.name for sub in self._subs)}>"

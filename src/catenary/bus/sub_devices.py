"""SubDevices: all devices of a segment, by position, name, kind and alias."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from itertools import takewhile
from typing import overload

from catenary import notebook
from catenary.bus.sub_device import SubDevice
from catenary.errors import SegmentError

HEADINGS = (
    *("position", "name", "order"),
    *("vendor", "product", "revision", "serial"),
    *("alias", "state"),
)


class SubDevices(Sequence[SubDevice]):
    """The devices of a segment: `subs[2]`, `subs["EL2004"]`, `subs.by_alias(10)`, `subs.drives`."""

    def __init__(self, subs: Sequence[SubDevice] = ()) -> None:
        self._subs = tuple(subs)

    @property
    def drives(self) -> tuple[SubDevice, ...]:
        """Devices with CiA 402 axes or SERCOS drives."""
        return tuple(s for s in self._subs if s.is_drive or s.description.sercos_axes)

    def by_alias(self, alias: int) -> SubDevice:
        """Return the device with this station alias.

        Raises:
            SegmentError: No device has the alias, or several devices have it.
            ValueError: The alias is not in the range 1 to 65535. 0 means that a device has no
                alias.
        """
        found = self._with_alias(alias)
        if found is None:
            known = ", ".join(f"{sub.alias} ({sub.station})" for sub in self._subs if sub.alias)
            raise SegmentError(
                f"no device has the alias {alias}",
                hint=f"known aliases: {known or 'none'}; to set one, run catenary alias TARGET "
                "POSITION VALUE",
            )
        return found

    def group(self, alias: int) -> tuple[SubDevice, ...]:
        """Return the device with this alias and those without an alias that directly follow it.

        For example, this finds the devices of a tool, regardless of where the tool is plugged in.
        The tuple is empty if no device has the alias.

        Raises:
            SegmentError: Several devices have the alias.
            ValueError: The alias is not in the range 1 to 65535. 0 means that a device has no
                alias.
        """
        head = self._with_alias(alias)
        if head is None:
            return ()
        following = self._subs[head.position + 1 :]
        return (head, *takewhile(lambda sub: not sub.alias, following))

    def _with_alias(self, alias: int) -> SubDevice | None:
        if not 1 <= alias <= 0xFFFF:
            raise ValueError(
                f"alias {alias} is not in the range 1 to 65535; 0 means that a device has no alias"
            )
        heads = [sub for sub in self._subs if sub.alias == alias]
        if len(heads) > 1:
            raise SegmentError(
                f"devices {_positions(heads)} have the same alias {alias}",
                hint="give each one its own alias: catenary alias TARGET POSITION VALUE",
            )
        return heads[0] if heads else None

    def _named(self, name: str) -> SubDevice:
        found = [sub for sub in self._subs if sub.name == name] or [
            sub for sub in self._subs if sub.order == name
        ]
        if len(found) == 1:
            return found[0]
        if found:
            raise SegmentError(
                f"{len(found)} devices have the name {name!r}: positions {_positions(found)}",
                hint="use the position, or give each one an alias and use subs.by_alias(...)",
            )
        known = dict.fromkeys(text for sub in self._subs for text in (sub.name, sub.order) if text)
        near = get_close_matches(name, known, n=3) or list(known)
        raise SegmentError(
            f"no device has the name or the order code {name!r}",
            hint=f"known names: {', '.join(map(repr, near))}" if near else "no device has a name",
        )

    @overload
    def __getitem__(self, key: int | str) -> SubDevice: ...
    @overload
    def __getitem__(self, key: slice) -> tuple[SubDevice, ...]: ...
    def __getitem__(self, key: int | str | slice) -> SubDevice | tuple[SubDevice, ...]:
        """Return the device with this position, name or order code.

        A slice returns a tuple of devices.

        Raises:
            IndexError: There is no such position.
            SegmentError: No device has the name, or several devices have it.
        """
        if isinstance(key, str):
            return self._named(key)
        try:
            return self._subs[key]
        except IndexError:
            count = len(self._subs)
            raise IndexError(
                f"no device {key}: the segment has {count} devices"
                + (f", 0 to {count - 1}" if count else "")
            ) from None

    def __len__(self) -> int:
        return len(self._subs)

    def __iter__(self) -> Iterator[SubDevice]:
        return iter(self._subs)

    def _repr_html_(self) -> str:
        """Return a table for notebooks."""
        return notebook.table(HEADINGS, map(_cells, self._subs))

    def __repr__(self) -> str:
        return f"<{len(self._subs)} SubDevices: {', '.join(sub.name for sub in self._subs)}>"


def _cells(sub: SubDevice) -> list[str]:
    identity = sub.identity
    numbers = f"0x{identity.vendor:08X}", f"0x{identity.product:08X}", f"0x{identity.revision:08X}"
    state = "failed" if sub.error is not None else str(sub.state or "unknown")
    names = sub.name, sub.order
    return [str(sub.position), *names, *numbers, str(identity.serial), str(sub.alias), state]


def _positions(subs: Sequence[SubDevice]) -> str:
    return ", ".join(str(sub.position) for sub in subs)

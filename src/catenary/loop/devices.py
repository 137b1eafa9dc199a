"""From wishes to the one MainDevice they are about."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from catenary.bus import MainDevice, SubDevice
from catenary.plan.request import Wish


class DeviceWish(Wish, Protocol):
    """A wish that knows whom it is about."""

    @property
    def subs(self) -> Sequence[SubDevice]: ...


def main_device_of(wishes: Sequence[DeviceWish]) -> MainDevice:
    """The MainDevice that all wishes share."""
    [(main, _)] = by_network(wishes)
    return main


def by_network(wishes: Sequence[DeviceWish]) -> list[tuple[MainDevice, list[DeviceWish]]]:
    """The wishes of each MainDevice, in the order of its first one."""
    networks: dict[int, tuple[MainDevice, list[DeviceWish]]] = {}
    for wish in wishes:
        mains = {id(sub.main): _main_of(sub) for sub in wish.subs}
        if len(mains) > 1:
            raise ValueError(
                "one wish with devices of several MainDevices: make one for each, and give the "
                "Loop both"
            )
        for key, main in mains.items():
            networks.setdefault(key, (main, []))[1].append(wish)
    if not networks:
        raise ValueError("a Loop needs a wish: Drives, Inputs or Outputs")
    return list(networks.values())


def _main_of(sub: SubDevice) -> MainDevice:
    """Return the MainDevice of a device, with all that a loop needs of it."""
    if not isinstance(sub.main, MainDevice):
        raise TypeError(f"{sub.station} belongs to a {type(sub.main).__name__}, not a MainDevice")
    return sub.main

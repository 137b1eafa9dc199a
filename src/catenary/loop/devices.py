"""From requests to their MainDevices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from catenary.bus import MainDevice, SubDevice
from catenary.plan.request import Wish

REQUESTS = "Drives, Inputs, Outputs or ProcessData"
PARTS = ("subs", "pdos", "tables", "bind")  # of a DeviceWish


class DeviceWish(Wish, Protocol):
    """A request that names its devices."""

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
        check_request(wish)
        mains = {id(sub.main): _main_of(sub) for sub in wish.subs}
        if len(mains) > 1:
            raise ValueError(
                "one request with devices of several MainDevices: make one for each, and give the "
                "Loop both"
            )
        for key, main in mains.items():
            networks.setdefault(key, (main, []))[1].append(wish)
    if not networks:
        raise ValueError(f"a Loop needs a process-data request: {REQUESTS}")
    return list(networks.values())


def check_request(request: object) -> None:
    """Raise TypeError for what is not a process-data request, such as a SubDevice."""
    if isinstance(request, type) or not all(hasattr(request, name) for name in PARTS):
        raise TypeError(f"a Loop takes process-data requests ({REQUESTS}), not {request!r}")


def _main_of(sub: SubDevice) -> MainDevice:
    """Return the MainDevice of a device, with all that a loop needs of it."""
    if not isinstance(sub.main, MainDevice):
        raise TypeError(f"{sub.station} belongs to a {type(sub.main).__name__}, not a MainDevice")
    return sub.main

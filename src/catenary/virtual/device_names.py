"""Names of the devices of a segment: those of a machine file, and their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from catenary.virtual._segment import Core
from catenary.virtual.devices.device import Device

STATION_ADDRESS = 0x0010


class DeviceNames:
    """Positions of devices by name. Names of a machine file come first.

    A name of a machine file belongs to a position, so it denotes a replaced device as well.
    """

    def __init__(self, core: Core, devices: Sequence[Device]) -> None:
        self._core = core
        self._devices = devices
        self._given: dict[str, int] = {}

    def give(self, stations: Mapping[str, int]) -> None:
        """Set the names of a machine file.

        Args:
            stations: Station address of each device, by its name, as the last scan set it.
        """
        present = {
            int.from_bytes(self._core.peek(n, STATION_ADDRESS, 2), "little"): n
            for n in range(len(self._devices))
        }
        self._given = {
            name: present[address] for name, address in stations.items() if address in present
        }

    def find(self, name: str) -> int:
        """Return the position of the device with a name.

        Raises:
            KeyError: No device has the name, or several have it.
        """
        if name in self._given:
            return self._given[name]
        names = [device.name for device in self._devices]
        if names.count(name) == 1:
            return names.index(name)
        many = ", ".join(str(n) for n, each in enumerate(names) if each == name)
        known = ", ".join(map(repr, dict.fromkeys([*self._given, *names])))
        what = f"devices {many} are named {name!r}" if many else f"no device is named {name!r}"
        raise KeyError(f"{what}; the names are {known}")

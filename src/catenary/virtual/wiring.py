"""Topology of a segment: a tree in the order in which frames are processed, or a ring.

A frame leaves a controller through port 3, then 1, then 2. It skips unconnected ports, and returns
through port 0 (ET1100 datasheet, section I, 3.2). This order determines the positions of devices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple, TypeAlias

Place: TypeAlias = tuple[int, int]  # device and port
Neighbour: TypeAlias = int | Literal["main"]  # a device, or the MainDevice

FIRST, SECOND = -1, -2  # interfaces of the MainDevice, numbered as in the compiled code
PORT_ORDER = (3, 1, 2)


class Cable(NamedTuple):
    """Cable between two ports.

    Cable n is the uplink of device n. In a ring, one more cable returns to the MainDevice.
    """

    up: Place
    down: Place


class Wiring:
    """The cables of a segment.

    Args:
        ports: Port numbers of each device.
        behind: Mapping from a device to the (device, port) that it is connected to. The default is
            port 1 of the previous device.
        ring: True if port 1 of the last device leads back to the MainDevice.

    Raises:
        ValueError: The devices cannot be connected in this way.
    """

    def __init__(
        self, ports: Sequence[Sequence[int]], behind: Mapping[int, Place], *, ring: bool
    ) -> None:
        self._below: dict[Place, int] = {}
        for device in behind:
            if not 0 < device < len(ports):
                raise ValueError(
                    f"behind: device {device} cannot be placed; use devices 1 to {len(ports) - 1}"
                )
        cables = [Cable((FIRST, 0), (0, 0))] if ports else []
        for device in range(1, len(ports)):
            up = tuple(behind.get(device, (device - 1, 1)))
            self._connect(device, (up[0], up[1]), ports)
            cables.append(Cable((up[0], up[1]), (device, 0)))
        self._check_order(len(ports))
        if ring:
            cables.append(Cable(_last_port(ports), (SECOND, 0)))
        self.ring = ring
        self.cables = tuple(cables)

    def _connect(self, device: int, up: Place, ports: Sequence[Sequence[int]]) -> None:
        above, port = up
        if not 0 <= above < device:
            raise ValueError(
                f"behind: device {device} must be behind one of the devices 0 to {device - 1}, "
                f"not {above}"
            )
        if port not in PORT_ORDER or port not in ports[above]:
            raise ValueError(f"behind: device {above} has no port {port} for device {device}")
        if up in self._below:
            raise ValueError(
                f"behind: port {port} of device {above} is already connected to"
                f" device {self._below[up]}"
            )
        self._below[up] = device

    def _check_order(self, count: int) -> None:
        order: list[int] = []
        waiting = [0] if count else []
        while waiting:
            device = waiting.pop()
            order.append(device)
            below = [self._below.get((device, port), -1) for port in PORT_ORDER]
            waiting += [child for child in reversed(below) if child >= 0]
        if order != list(range(count)):
            raise ValueError(
                f"behind: frames reach the devices in the order {order} (ports 3, 1, 2); "
                "list the devices in this order"
            )

    def between(self, one: Neighbour, other: Neighbour) -> int:
        """Return the number of the cable between two neighbours.

        Args:
            one: A device, or "main".
            other: The device at the other end of the cable, or "main".

        Raises:
            ValueError: No cable connects the two neighbours. The message lists the cables.
        """
        for number, cable in enumerate(self.cables):
            if {_name(cable.up), _name(cable.down)} == {one, other}:
                return number
        known = ", ".join(f"{_name(c.up)}-{_name(c.down)}" for c in self.cables[:40])
        raise ValueError(f"between: {one} and {other} are not neighbours; the cables are {known}")

    def cable_at(self, device: int, port: int) -> int:
        """Return the number of the cable at a port.

        Args:
            device: A device.
            port: Number of the port.

        Raises:
            ValueError: No cable belongs to the port.
        """
        for number, cable in enumerate(self.cables):
            if device >= 0 and (device, port) in (cable.up, cable.down):
                return number
        raise ValueError(f"no cable belongs to port {port} of device {device}")

    def at_port(self, device: int, port: int) -> bool:
        """Return True if a cable is connected to this port."""
        return any((device, port) in (cable.up, cable.down) for cable in self.cables)


def _last_port(ports: Sequence[Sequence[int]]) -> Place:
    if not ports:
        raise ValueError("ring: a ring needs at least one device")
    if 1 not in ports[-1]:
        raise ValueError(
            f"ring: the last device, {len(ports) - 1}, has no port 1 for the returning cable"
        )
    return len(ports) - 1, 1


def _name(place: Place) -> Neighbour:
    return "main" if place[0] < 0 else place[0]

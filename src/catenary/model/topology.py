"""The tree of the segment from the ports that are open, ETG.1000.4 §6.1.3 (DL status 0x0110).

A frame enters at port 0 and leaves by the open ports in the order 0 → 3 → 1 → 2; positions count
in that order, so the list of open ports per position is enough to find every device's parent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from catenary.wire.dl import DlStatus

PORT_ORDER = (3, 1, 2)  # in which a device sends a frame onwards after port 0
Ports = tuple[bool, bool, bool, bool]


@dataclass(frozen=True, slots=True)
class Place:
    parent: int | None  # position; None: wired to the MainDevice
    parent_port: int | None


def open_ports(dl_status: int) -> Ports:
    """Ports with a communicating neighbour."""
    port_0, port_1, port_2, port_3 = DlStatus.from_word(dl_status).ports
    return (
        port_0.communication,
        port_1.communication,
        port_2.communication,
        port_3.communication,
    )


def tree(ports: Sequence[Ports]) -> tuple[Place, ...]:
    """The place of each device. A contradiction (more devices than open ports) ends in a device
    without a parent: what the registers say is then not a tree."""
    places: list[Place] = []
    unfilled: list[tuple[int, int]] = []  # (position, port), the next to be filled last
    for position, open_here in enumerate(ports):
        if unfilled:
            parent, port = unfilled.pop()
            places.append(Place(parent, port))
        else:
            places.append(Place(None, None))
        onwards = [(position, port) for port in PORT_ORDER if open_here[port]]
        unfilled.extend(reversed(onwards))
    return tuple(places)

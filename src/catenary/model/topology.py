"""Tree of the segment, derived from the open ports of all devices, ETG.1000.4 §6.1.3 (0x0110).

A frame enters at port 0 and leaves by the open ports in the order 0 → 3 → 1 → 2. Positions follow
this order. The open ports per position are therefore sufficient to find the parent of every device.

Contradictions are reported, not corrected: a device with swapped IN and OUT, or an open port
without a device behind it. SOEM (`ecx_configdc`) takes the port with the earliest receive time as
the entry. Even then, the order of the devices does not show which ones are behind the swapped one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from catenary.wire.dl import DlStatus

PORT_ORDER = (3, 1, 2)  # order in which a device forwards a frame after port 0
Ports = tuple[bool, bool, bool, bool]


@dataclass(frozen=True, slots=True)
class Place:
    """Place of one device in the tree."""

    parent: int | None  # position; None if wired to the MainDevice, or without a place
    parent_port: int | None


def open_ports(dl_status: int) -> Ports:
    """Return one flag per port: True if it communicates with a neighbour."""
    port_0, port_1, port_2, port_3 = DlStatus.from_word(dl_status).ports
    return (
        port_0.communication,
        port_1.communication,
        port_2.communication,
        port_3.communication,
    )


def tree(ports: Sequence[Ports]) -> tuple[Place, ...]:
    """Return the place of each device in the tree.

    If there are more devices than open ports, the registers do not describe a tree. In this case,
    devices for which no open port remains have no parent.
    """
    places: list[Place] = []
    unfilled: list[tuple[int, int]] = []  # (position, port); the last one is next
    for position, open_here in enumerate(ports):
        if unfilled:
            parent, port = unfilled.pop()
            places.append(Place(parent, port))
        else:
            places.append(Place(None, None))
        onwards = [(position, port) for port in PORT_ORDER if open_here[port]]
        unfilled.extend(reversed(onwards))
    return tuple(places)


class Cable(NamedTuple):
    """A cable between two ports. If `upper` is None, the upper end is the MainDevice."""

    upper: int | None
    upper_port: int | None
    lower: int
    lower_port: int = 0


@dataclass(frozen=True, slots=True)
class Topology:
    """The tree of a segment. `ports` and `places` are indexed by position.

    In a ring, `second_end` is the (position, port) wired to the MainDevice's second interface. It
    is None if this port is not open or cannot be identified, and on a line.

    `cables` holds the cables to all devices that have a place, by position.
    """

    ports: tuple[Ports, ...]
    places: tuple[Place, ...]
    contradictions: tuple[str, ...] = ()
    second_end: tuple[int, int] | None = None
    cables: tuple[Cable, ...] = field(init=False, repr=False, compare=False)
    _cables_of: Mapping[int, list[Cable]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        cables = tuple(
            Cable(place.parent, place.parent_port, position)
            for position, place in enumerate(self.places)
            if place.parent is not None or position == 0
        )
        found: dict[int, list[Cable]] = {}
        for cable in cables:
            if cable.upper is not None:
                found.setdefault(cable.upper, []).append(cable)
            found.setdefault(cable.lower, []).append(cable)
        object.__setattr__(self, "cables", cables)
        object.__setattr__(self, "_cables_of", found)

    def __len__(self) -> int:
        return len(self.ports)

    def cables_of(self, position: int) -> Sequence[Cable]:
        """Return the cables of a device, ordered by the positions at their lower ends."""
        return self._cables_of.get(position, ())

    def children(self, position: int) -> tuple[Cable, ...]:
        """Return the cables from a device to its children, in the order a frame passes them."""
        return tuple(cable for cable in self.cables_of(position) if cable.upper == position)

    def cable_at(self, position: int, port: int) -> Cable | None:
        """Return the cable at a port; None if no cable is known there.

        Args:
            position: Position of the device.
            port: The port of the device.
        """
        for cable in self.cables_of(position):
            if (position, port) in (cable[:2], cable[2:]):
                return cable
        return None

    def path(self) -> tuple[tuple[int, int], ...]:
        """Return all ports (position, port) at which a frame arrives, in order, out and back."""
        arrivals: list[tuple[int, int]] = []
        waiting = [(cable.lower, cable.lower_port) for cable in self.cables[:1]]
        while waiting:
            position, port = waiting.pop()
            arrivals.append((position, port))
            if port != 0:
                continue
            for cable in reversed(self.children(position)):
                assert cable.upper_port is not None
                waiting += [(position, cable.upper_port), (cable.lower, cable.lower_port)]
        return tuple(arrivals)


def make_topology(ports: Sequence[Ports], *, ring: bool = False) -> Topology:
    """Return the tree of the devices and its contradictions.

    Args:
        ports: Open ports of each device, by position.
        ring: True for a ring. One open port without a device behind it is then wired to the second
            interface of the MainDevice. If the ring is cut, the MainDevice reaches the devices
            after the cut through this interface.
    """
    places = tree(ports)
    taken = {(place.parent, place.parent_port) for place in places}
    unanswered = [
        (position, port)
        for position, open_here in enumerate(ports)
        for port in PORT_ORDER
        if open_here[port] and (position, port) not in taken
    ]
    second_end = unanswered.pop() if ring and len(unanswered) == 1 else None
    cuts = [n for n, open_here in enumerate(ports) if n and ring and not open_here[0]]
    if len(cuts) == 1 and second_end is not None:
        text = f"the ring is cut between device {cuts[0] - 1} and device {cuts[0]}"
        return Topology(tuple(ports), places, (text,), second_end)
    found = [
        *_entered_elsewhere(ports),
        *_without_a_place(places, unanswered),
        *(
            f"device {position} port {port} is open, but no device answers behind it: it is "
            "connected to a non-EtherCAT device, to a device without firmware, or to the "
            "MainDevice's second interface (a ring)"
            for position, port in unanswered
            if ports[position][0] and (position == 0 or places[position].parent is not None)
        ),
    ]
    return Topology(tuple(ports), places, tuple(found), second_end)


def _entered_elsewhere(ports: Sequence[Ports]) -> Iterator[str]:
    for position, open_here in enumerate(ports):
        if open_here[0]:
            continue
        others = [str(port) for port in PORT_ORDER if open_here[port]]
        if others:
            yield (
                f"frames enter device {position} by port {' or '.join(others)}, and its port 0 is "
                "closed: its IN and OUT are swapped"
            )
        else:
            yield f"device {position} answers, but none of its ports is open"


def _without_a_place(
    places: Sequence[Place], unanswered: Sequence[tuple[int, int]]
) -> Iterator[str]:
    for position, place in enumerate(places):
        if position == 0 or place.parent is not None:
            continue
        if any(open_at == position for open_at, _ in unanswered):
            cause = "its IN and OUT are swapped: devices behind it answer before it"
        else:
            cause = "a port opened or closed while the devices were counted: scan again"
        yield f"device {position} has no place in the tree: no open port is left for it; {cause}"

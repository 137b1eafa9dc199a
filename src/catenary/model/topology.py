"""The tree of the segment from the ports that are open, ETG.1000.4 §6.1.3 (DL status 0x0110).

A frame enters at port 0 and leaves by the open ports in the order 0 → 3 → 1 → 2; positions count
in that order, so the list of open ports per position is enough to find every device's parent.

What is not a tree is said, not mended: a device that is wired the wrong way round, a port that is
open where nobody answers. (SOEM, `ecx_configdc`, takes the earliest receive time for the port of
entry; which devices are behind a swapped one the order of answers does not tell all the same.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

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


class Cable(NamedTuple):
    """What carries frames between two ports. `upper` None: the MainDevice."""

    upper: int | None
    upper_port: int | None
    lower: int
    lower_port: int = 0


@dataclass(frozen=True, slots=True)
class Topology:
    """A segment's tree. All tuples by position. `second_end`: the port (position, port) that is
    wired to the second interface of a ring's MainDevice."""

    ports: tuple[Ports, ...]
    places: tuple[Place, ...]
    contradictions: tuple[str, ...] = ()
    second_end: tuple[int, int] | None = None

    def __len__(self) -> int:
        return len(self.ports)

    @property
    def cables(self) -> tuple[Cable, ...]:
        """The cable to every device that has a place, by position."""
        return tuple(
            Cable(place.parent, place.parent_port, position)
            for position, place in enumerate(self.places)
            if place.parent is not None or position == 0
        )

    def children(self, position: int) -> tuple[Cable, ...]:
        """The cables from a device onwards, in the order of the frame."""
        return tuple(cable for cable in self.cables if cable.upper == position)

    def cable_at(self, position: int, port: int) -> Cable | None:
        """What is plugged into a port; None: nothing that is known of."""
        for cable in self.cables:
            if (position, port) in (cable[:2], cable[2:]):
                return cable
        return None

    def path(self) -> tuple[tuple[int, int], ...]:
        """The ports (position, port) at which a frame arrives, in its order, there and back."""
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
    """The tree of the devices, and what contradicts it. `ring`: one open port without a device
    behind it is that of the MainDevice's second interface; from there a cut ring's devices behind
    the cut are reached."""
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
            f"device {position} port {port} is open, but nobody answers behind it: a device that "
            "is no EtherCAT device or has no firmware, or the second port of a MainDevice (a ring)"
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
                f"device {position} is entered by port {' or '.join(others)}, its port 0 is "
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
            cause = "a port came or went while the devices were counted: look again"
        yield f"device {position} has no place: no open port is left for it; {cause}"

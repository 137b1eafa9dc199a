"""How long a frame takes from one device to the next, from the times at which one broadcast write
(0x0900) passed their ports: half of what it was away behind a port, less what it spent inside the
next device's branch. The same way there and back is assumed, as in `delays`."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.model.delays import TIME_SPAN, PortTimes
from catenary.model.topology import Cable, Topology

JITTER_NS = 200  # of four stamps: a tick of 10 ns each, those of slow PHYs some more


def cable_delays_ns(
    topology: Topology, times: Sequence[PortTimes | None]
) -> tuple[int | None, ...]:
    """By position: the way from the device before, one way [ns], cable and forwarding; None where
    one of the two has no clock, or no device is before it."""
    found: list[int | None] = [None] * len(topology)
    for position in range(len(topology)):
        before = 0  # the port at which the frame was last
        for cable in topology.children(position):
            found[cable.lower] = _delay(topology, times, cable, before)
            before = cable.upper_port or 0
    return tuple(found)


def _delay(
    topology: Topology, times: Sequence[PortTimes | None], cable: Cable, before: int
) -> int | None:
    upper, lower = times[cable.upper or 0], times[cable.lower]
    if upper is None or lower is None or cable.upper_port is None:
        return None
    away = (upper[cable.upper_port] - upper[before]) % TIME_SPAN
    onwards = topology.children(cable.lower)
    last = onwards[-1].upper_port if onwards else 0
    inside = (lower[last or 0] - lower[0]) % TIME_SPAN
    if away - inside < -JITTER_NS:
        return None  # the stamps are not of one frame
    return max(0, round((away - inside) / 2))

"""Delay of a frame from one device to the next.

It is computed from the times at which a broadcast write (0x0900) passed the ports. The time that
the frame spent behind a port minus the time in the branches of the next device is the round trip
between the two devices. The delay is half of it. As in `delays`, both directions are assumed to
take the same time.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.model.delays import TIME_SPAN, PortTimes
from catenary.model.topology import Cable, Topology

JITTER_NS = 200  # sum over four time stamps: one tick of 10 ns each, more with slow PHYs


def cable_delays_ns(
    topology: Topology, times: Sequence[PortTimes | None]
) -> tuple[int | None, ...]:
    """Return the one-way delay to each device from its parent [ns], by position.

    The delay includes cable and forwarding. It is None if one of the two devices has no clock,
    if there is no parent, or if the time stamps belong to different frames.

    Args:
        topology: The tree of the devices.
        times: Receive times of one latch, by position; None for a device without a clock.
    """
    found: list[int | None] = [None] * len(topology)
    for position in range(len(topology)):
        before = 0  # the port at which the frame last arrived
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
        return None  # the time stamps belong to different frames
    return max(0, round((away - inside) / 2))

"""How long a frame takes from the reference clock to every other clock, from the times at which one
broadcast write (0x0900) passed the ports. ETG.1000.4 §6.8.2; Beckhoff, ESC data sheet I, §9.1.2.

Between two ports of one device the frame was away on the cable behind the second. Taking from that
what it spent inside the next device's branch leaves the way there and back. Both take the same, but
for the processing units: a frame passes one as it leaves by a device's first port, and as it turns
round in the last device of a branch (data sheet: t_Diff). SOEM (`ecx_configdc`), IgH
(`ec_slave_calc_port_delays`) and ethercrab (`configure_subdevice_offsets`) leave that out: 20 ns
for each device on a line. Every clock measures with its own crystal; over some microseconds an
error of 100 ppm does not count.

Devices without clocks are cable: behind one that branches, several clocks may share what a clock
before it measured; then what is known of no part is shared out evenly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import NamedTuple

from catenary.model.topology import PORT_ORDER, Ports

PortTimes = tuple[int, int, int, int]
PROCESSING_NS = 40  # what a processing unit adds to forwarding; of other controllers, 20 to 40
TIME_SPAN = 1 << 32  # receive times are 32 bits wide and wrap every 4.3 s


@dataclass(frozen=True, slots=True)
class ClockPlace:
    """One device of the tree; `receive_times_ns`: of one latch, None where it has no clock."""

    parent: int | None
    parent_port: int | None
    open_ports: Ports
    receive_times_ns: PortTimes | None


class _Head(NamedTuple):
    """A clock, and how many devices without one lie before it."""

    position: int
    between: int


def delays_ns(latches: Sequence[Sequence[ClockPlace]]) -> tuple[int | None, ...]:
    """Delay of every device behind the first clock [ns], None where there is no clock.

    `latches`: the same devices, measured once or several times: the mean counts. What each gives
    is taken unrounded and as it is, below zero too: a wire shorter than the jitter of its stamps
    comes out right in the mean.
    """
    if not latches:
        raise ValueError("no delay without a measurement")
    several = [_delays(places) for places in latches]
    return tuple(
        None if None in column else max(0, round(fmean(d for d in column if d is not None)))
        for column in zip(*several, strict=True)
    )


def _delays(places: Sequence[ClockPlace]) -> list[float | None]:
    children = _children(places)
    delays: list[float | None] = [None] * len(places)
    _start(places, children, delays)
    for position, place in enumerate(places):
        times, delay = place.receive_times_ns, delays[position]
        if times is None or delay is None:
            continue
        before = 0  # the port the frame came back at last
        for port in _onwards(place):
            away = _interval(times, before, port)
            reached = delay + _interval(times, 0, before)
            heads = [
                head
                for child in children[position]
                if places[child].parent_port == port
                for head in _first_clocks(places, children, child)
            ]
            _share(places, heads, reached, away, delays, first=before == 0)
            before = port
    return delays


def _start(
    places: Sequence[ClockPlace],
    children: Sequence[Sequence[int]],
    delays: list[float | None],
) -> None:
    """The first clock is where counting begins. Further ones that no clock precedes (behind a
    branch without clocks) are reached after the branches before them, cables not known."""
    reached = 0.0
    for position, place in enumerate(places):
        if place.parent is not None:
            continue
        for head in _first_clocks(places, children, position):
            delays[head.position] = reached
            reached += _loop(places[head.position])


def _share(
    places: Sequence[ClockPlace],
    heads: Sequence[_Head],
    reached: float,
    away: float,
    delays: list[float | None],
    *,
    first: bool,
) -> None:
    """The first clocks behind one port, in the order of the frame. `first`: the frame leaves by
    this port straight from the processing unit."""
    wire = (away - sum(_loop(places[head.position]) for head in heads)) / (len(heads) + 1)
    if len(heads) == 1:
        [head] = heads
        turns = not _onwards(places[head.position])
        wire += PROCESSING_NS * (first + head.between - turns) / 2
    for head in heads:
        reached += wire
        delays[head.position] = reached
        reached += _loop(places[head.position])


def _loop(place: ClockPlace) -> float:
    """How long a frame is away behind a clock, all of its branches together."""
    assert place.receive_times_ns is not None
    ports = _onwards(place)
    return _interval(place.receive_times_ns, 0, ports[-1]) if ports else 0


def _interval(times: PortTimes, start: int, end: int) -> int:
    """From port to port, across the wrap; a little below zero where stamps jitter."""
    interval = (times[end] - times[start]) % TIME_SPAN
    return interval - TIME_SPAN if interval >= TIME_SPAN // 2 else interval


def _onwards(place: ClockPlace) -> list[int]:
    return [port for port in PORT_ORDER if place.open_ports[port]]


def _children(places: Sequence[ClockPlace]) -> list[list[int]]:
    children: list[list[int]] = [[] for _ in places]
    for position, place in enumerate(places):
        if place.parent is not None:
            children[place.parent].append(position)  # positions count in the frame's order
    return children


def _first_clocks(
    places: Sequence[ClockPlace], children: Sequence[Sequence[int]], start: int
) -> Iterator[_Head]:
    """The clocks of a branch that no clock of the branch precedes."""
    waiting = [_Head(start, 0)]
    while waiting:
        head = waiting.pop()
        if places[head.position].receive_times_ns is not None:
            yield head
        else:
            behind = reversed(children[head.position])
            waiting.extend(_Head(child, head.between + 1) for child in behind)

"""Propagation delays from the first clock to every other clock.

They are computed from the times at which a broadcast write (0x0900) passed the ports. ETG.1000.4
§6.8.2; Beckhoff, ESC data sheet I, §9.1.2.

The time between two ports of a device is the time that the frame spent in the branch behind the
second port. This time minus the time in the branches of the next device is the round trip between
the two devices. Both directions take the same time, except for the
processing units (data sheet: t_Diff). A frame passes a processing unit when it leaves by a device's
first port. It also passes one when it turns back in the last device of a branch. SOEM
(`ecx_configdc`), IgH (`ec_slave_calc_port_delays`) and ethercrab (`configure_subdevice_offsets`)
ignore this difference of 20 ns per device on a line. Every clock measures with its own crystal.
Over a few microseconds, an error of 100 ppm is negligible.

Devices without clocks count as cable. If such a device branches, several clocks may share one
measured time. The unknown part is then distributed evenly.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import NamedTuple

from catenary.model.topology import PORT_ORDER, Ports

PortTimes = tuple[int, int, int, int]
PROCESSING_NS = 40  # extra delay of a processing unit; 20 to 40 ns, depending on the controller
TIME_SPAN = 1 << 32  # receive times are 32 bits wide and wrap every 4.3 s


@dataclass(frozen=True, slots=True)
class ClockPlace:
    """One device of the tree.

    `receive_times_ns` are the times of one latch; None if the device has no clock.
    """

    parent: int | None
    parent_port: int | None
    open_ports: Ports
    receive_times_ns: PortTimes | None


class _Head(NamedTuple):
    """A clock, and the number of devices without a clock before it."""

    position: int
    between: int


def delays_ns(latches: Sequence[Sequence[ClockPlace]]) -> tuple[int | None, ...]:
    """Return the delay from the first clock to every device [ns]; None if it has no clock.

    The result is the mean over all latches, rounded, and at least 0. Single results are not rounded
    and may be negative. The mean is therefore correct even if a cable delay is shorter than the
    jitter of the clocks.

    Args:
        latches: The same devices, measured once or several times.

    Raises:
        ValueError: `latches` is empty.
    """
    if not latches:
        raise ValueError("delays_ns: needs at least one measurement")
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
        before = 0  # the port at which the frame last returned
        for port in _downstream_ports(place):
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
    """Set the delays of the clocks without a clock before them. The first one has delay 0.

    Further such clocks are in other branches of a device without a clock. The frame reaches them
    after the earlier branches; the unknown cable delays are ignored.
    """
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
    """Set the delays of the first clocks behind one port.

    Args:
        places: All devices.
        heads: The first clocks behind the port, in the order in which a frame reaches them.
        reached: Delay from the first clock when the frame leaves by the port [ns].
        away: Time until the frame returns to the port [ns].
        delays: The list to change.
        first: True if the frame reaches this port directly from the processing unit.
    """
    wire = (away - sum(_loop(places[head.position]) for head in heads)) / (len(heads) + 1)
    if len(heads) == 1:
        [head] = heads
        turns = not _downstream_ports(places[head.position])
        wire += PROCESSING_NS * (first + head.between - turns) / 2
    for head in heads:
        reached += wire
        delays[head.position] = reached
        reached += _loop(places[head.position])


def _loop(place: ClockPlace) -> float:
    """Return the time [ns] that a frame spends in all branches behind a clock."""
    assert place.receive_times_ns is not None
    ports = _downstream_ports(place)
    return _interval(place.receive_times_ns, 0, ports[-1]) if ports else 0


def _interval(times: PortTimes, start: int, end: int) -> int:
    """Return the time between two ports [ns], with wrap-around. Jitter can make it negative."""
    interval = (times[end] - times[start]) % TIME_SPAN
    return interval - TIME_SPAN if interval >= TIME_SPAN // 2 else interval


def _downstream_ports(place: ClockPlace) -> list[int]:
    return [port for port in PORT_ORDER if place.open_ports[port]]


def _children(places: Sequence[ClockPlace]) -> list[list[int]]:
    children: list[list[int]] = [[] for _ in places]
    for position, place in enumerate(places):
        if place.parent is not None:
            children[place.parent].append(position)  # in the order in which a frame passes them
    return children


def _first_clocks(
    places: Sequence[ClockPlace], children: Sequence[Sequence[int]], start: int
) -> Iterator[_Head]:
    """Yield the first clocks of a branch: those without another clock of the branch before them."""
    waiting = [_Head(start, 0)]
    while waiting:
        head = waiting.pop()
        if places[head.position].receive_times_ns is not None:
            yield head
        else:
            behind = reversed(children[head.position])
            waiting.extend(_Head(child, head.between + 1) for child in behind)

"""A ring as the MainDevice sees it: where it is cut, and devices addressed from both ends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, Protocol

from catenary.bus.runner import BlockingRunner
from catenary.errors import ClockError, SegmentError
from catenary.link import RingLink
from catenary.link.ring_state import RingState, Shape
from catenary.model.device import DeviceDescription
from catenary.model.topology import make_topology
from catenary.procedure.clocks import RingEnd
from catenary.procedure.stations import StationRegisters, assign, count

Ends = tuple[int | None, int | None]  # positions at the ends of a cable; None: the MainDevice


class HasState(Protocol):
    @property
    def state(self) -> RingState: ...


class Cuts(NamedTuple):
    """Which cables of a ring do not carry, and whom nothing reaches for that reason."""

    cables: tuple[Ends, ...]
    island: tuple[int, ...]  # positions

    def __str__(self) -> str:
        if not self.cables:
            return "the ring is closed"
        where = " and ".join(map(named, self.cables))
        if not self.island:
            return f"the ring is cut between {where}"
        first, last = self.island[0], self.island[-1]
        who = (
            f"device {first} is an island" if first == last else f"{first} to {last} are an island"
        )
        return f"the ring is cut between {where}: {who}"


def named(cable: Ends) -> str:
    """A cable by what is at its ends."""
    first, second = cable
    if first is None:
        return f"the first port and device {second}"
    if second is None:
        return f"device {first} and the second port"
    return f"{first} and {second}"


def find_cuts(state: RingState, device_count: int) -> Cuts | None:
    """Where a ring of so many devices is cut, by how many are reached from each end; None: it is
    not known. One cable carries nothing: a cut; two or more: those between are an island."""
    if state.shape is Shape.CLOSED:
        return Cuts((), ())
    if state.shape not in (Shape.CUT, Shape.FIRST_ONLY, Shape.SECOND_ONLY):
        return None
    first, second = state.first_devices, state.second_devices
    if first + second > device_count:
        return None  # counted in different moments
    upper = first - 1 if first else None
    lower = device_count - second if second else None
    if first + second == device_count:
        return Cuts(((upper, lower),), ())
    island = tuple(range(first, device_count - second))
    return Cuts(((upper, island[0]), (island[-1], lower)), island)


def check_direction(state: RingState) -> None:
    """SegmentError where the two ports are swapped: what is sent on the first passes all devices
    from behind, where nobody processes it."""
    if state.shape is Shape.CLOSED and state.second_devices and not state.first_devices:
        raise SegmentError(
            "the ring is wired the wrong way round: its devices are entered from the second port",
            hint="swap the two cables at the MainDevice, or the names of its ports",
        )


def assign_from_both_ends(
    runner: BlockingRunner, ring: RingLink, device_count: int
) -> Sequence[StationRegisters]:
    """Station addresses by position. Where the ring is cut, those behind the cut are reached from
    the second end: what comes from there passes them all unprocessed, turns round at the cut, and
    is processed on its way back, by the device at the cut first."""
    state = ring.state
    check_direction(state)
    if state.shape is not Shape.CUT and state.shape is not Shape.SECOND_ONLY:
        return runner.run(assign(range(device_count)))
    with routed(ring, "first"):
        found = list(runner.run(assign(range(state.first_devices))) if state.first_devices else ())
    with routed(ring, "second"):
        found += runner.run(assign(range(state.first_devices, device_count)))
    return found


def end_for_clocks(
    runner: BlockingRunner, ring: RingLink, devices: Sequence[DeviceDescription]
) -> RingEnd | None:
    """The port to close while delays are measured; None: the ring is cut right there, and a line
    already. ClockError where it is cut elsewhere: frames from two ends bring no common time."""
    device_count = runner.run(count()).devices  # renews the state
    topology = make_topology([device.open_ports for device in devices], ring=True)
    state = ring.state
    if state.shape is not Shape.CLOSED:
        if state.first_devices == device_count:
            return topology.second_end
        cuts = find_cuts(state, device_count)
        raise ClockError(
            f"clocks: {cuts or 'the ring is cut'}; who is behind it has no common time with those "
            "before it",
            hint="mend the cable and scan again, or leave dc= out",
        )
    if topology.second_end is None or topology.contradictions:
        raise ClockError(
            "clocks: the ring was cut when it was scanned, and is closed now",
            hint="scan again: the ports tell where its second end is",
        )
    return topology.second_end


@contextmanager
def routed(ring: RingLink, route: str) -> Iterator[None]:
    """Frames go out on one link only: positions count from there."""
    before, ring.route = ring.route, route
    try:
        yield
    finally:
        ring.route = before

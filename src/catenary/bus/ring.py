"""A ring as the MainDevice sees it: where it is cut, and devices addressed from both ends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, Protocol

from catenary.bus.runner import BlockingRunner
from catenary.link import RingLink
from catenary.link.ring_state import RingState, Shape
from catenary.procedure.stations import StationRegisters, assign

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


def assign_from_both_ends(
    runner: BlockingRunner, ring: RingLink, device_count: int
) -> Sequence[StationRegisters]:
    """Station addresses by position. Where the ring is cut, those behind the cut are reached from
    the second end: what comes from there passes them all unprocessed, turns round at the cut, and
    is processed on its way back, by the device at the cut first."""
    state = ring.state
    if state.shape is not Shape.CUT and state.shape is not Shape.SECOND_ONLY:
        return runner.run(assign(range(device_count)))
    with routed(ring, "first"):
        found = list(runner.run(assign(range(state.first_devices))) if state.first_devices else ())
    with routed(ring, "second"):
        found += runner.run(assign(range(state.first_devices, device_count)))
    return found


@contextmanager
def routed(ring: RingLink, route: str) -> Iterator[None]:
    """Frames go out on one link only: positions count from there."""
    before, ring.route = ring.route, route
    try:
        yield
    finally:
        ring.route = before

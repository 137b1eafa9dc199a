"""Cuts of a ring, and addressing of its devices from both ends."""

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
    """Cables of a ring that carry no frames, and the devices that are unreachable as a result."""

    cables: tuple[Ends, ...]
    island: tuple[int, ...]  # positions of the unreachable devices

    def __str__(self) -> str:
        if not self.cables:
            return "the ring is closed"
        where = " and ".join(map(named, self.cables))
        if not self.island:
            return f"the ring is cut between {where}"
        first, last = self.island[0], self.island[-1]
        unreachable = f"device {first} is" if first == last else f"devices {first} to {last} are"
        return f"the ring is cut between {where}: {unreachable} unreachable"


def named(cable: Ends) -> str:
    """Return the description of a cable: its two ends."""
    first, second = cable
    if first is None:
        return f"the first port and device {second}"
    if second is None:
        return f"device {first} and the second port"
    return f"{first} and {second}"


def find_cuts(state: RingState, device_count: int) -> Cuts | None:
    """Return the cuts of a ring, from the number of devices that each end reaches.

    If the two ends together reach all devices, one cable is cut. Otherwise, the devices between two
    cuts are unreachable.

    Args:
        state: State of the ring.
        device_count: Number of devices in the ring.

    Returns:
        The cuts; None if they are unknown.
    """
    if state.shape is Shape.CLOSED:
        return Cuts((), ())
    if state.shape not in (Shape.CUT, Shape.FIRST_ONLY, Shape.SECOND_ONLY):
        return None
    first, second = state.first_devices, state.second_devices
    if first + second > device_count:
        return None  # the counts were taken at different times
    upper = first - 1 if first else None
    lower = device_count - second if second else None
    if first + second == device_count:
        return Cuts(((upper, lower),), ())
    island = tuple(range(first, device_count - second))
    return Cuts(((upper, island[0]), (island[-1], lower)), island)


def check_direction(state: RingState) -> None:
    """Raise SegmentError if the ring is closed and its two ports are swapped.

    Frames of the first port then pass all devices in the unprocessed direction.
    """
    if state.shape is Shape.CLOSED and state.second_devices and not state.first_devices:
        raise SegmentError(
            "the ring is wired in the wrong direction: frames enter from the second port",
            hint="swap the two cables at the MainDevice, or the names of its ports",
        )


def assign_from_both_ends(
    runner: BlockingRunner, ring: RingLink, device_count: int
) -> Sequence[StationRegisters]:
    """Give the devices their station addresses, and return their registers by position.

    In an open ring, the devices after the cut are reached from the second end. A frame from there
    passes them unprocessed, turns at the cut, and is processed on its way back. The device at the
    cut is therefore the first one.

    Args:
        runner: Runner of the procedures.
        ring: Ring link.
        device_count: Number of devices in the ring.

    Raises:
        SegmentError: The two ports are swapped.
    """
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
    """Count the devices, and return the port to close while delays are measured.

    Args:
        runner: Runner of the procedures.
        ring: Ring link.
        devices: Descriptions of the devices.

    Returns:
        The port; None if the ring was already open at that port during the scan.

    Raises:
        ClockError: The ring is cut elsewhere, so its two parts cannot be synchronised; or it was
            cut during the scan, but is closed now.
    """
    device_count = runner.run(count()).devices  # this also updates `ring.state`
    topology = make_topology([device.open_ports for device in devices], ring=True)
    state = ring.state
    if state.shape is not Shape.CLOSED:
        if state.first_devices == device_count:
            return topology.second_end
        cuts = find_cuts(state, device_count)
        raise ClockError(
            f"clocks: {cuts or 'the ring is cut'}; the clocks after the cut cannot be synchronised "
            "with those before it",
            hint="repair the cable and scan again, or omit dc=",
        )
    if topology.second_end is None or topology.contradictions:
        raise ClockError(
            "clocks: the ring was cut during the scan, but is closed now",
            hint="scan again to find the port at its second end",
        )
    return topology.second_end


@contextmanager
def routed(ring: RingLink, route: str) -> Iterator[None]:
    """Within the block, send frames on one link only. Positions count from its end.

    Args:
        ring: Ring link.
        route: "first" or "second".
    """
    before, ring.route = ring.route, route
    try:
        yield
    finally:
        ring.route = before

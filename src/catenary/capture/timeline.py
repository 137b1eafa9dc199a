"""Timelines of captures: a stream of events, or all events at once."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from catenary.capture.clocks import ClockStatistics, ReferenceStatistics
from catenary.capture.cycles import CycleStatistics
from catenary.capture.events import Device, Event, Master
from catenary.capture.file import CaptureFile, FileCounts
from catenary.capture.master_follower import MasterFollower
from catenary.capture.pairing import FramePair, pair_frames

MAXIMUM_EVENTS = 1_000_000


@dataclass(frozen=True, slots=True)
class MasterSummary:
    """A master, its devices, and the statistics at the end of the capture.

    `clocks` has the differences of the devices by their number.
    """

    master: Master
    devices: tuple[Device, ...]
    cycles: tuple[CycleStatistics, ...]
    clocks: dict[int, ClockStatistics]
    reference: ReferenceStatistics | None


@dataclass(frozen=True, slots=True)
class Timeline:
    """All events of a capture. `complete` is False after `MAXIMUM_EVENTS` events."""

    events: tuple[Event, ...]
    masters: tuple[MasterSummary, ...]
    counts: FileCounts
    complete: bool = True

    def device_of(self, event: Event) -> Device | None:
        """Return the device of an event; None if the event concerns no single device."""
        return None if event.device is None else self.masters[event.master].devices[event.device]


class EventStream:
    """Owner of the masters of a capture while it is read.

    Iterate over it once. Memory does not depend on the length of the capture.
    """

    def __init__(self, read: Callable[[int], bytes], *, until_ns: int | None = None) -> None:
        """Read a file.

        Args:
            read: `read(size)` returns the next bytes, fewer only at the end of the file.
            until_ns: Stop at the first packet after this time since the first packet.

        Raises:
            DecodeError: The format is unknown.
        """
        self._file = CaptureFile(read, until_ns=until_ns)
        self._by_source: dict[bytes, MasterFollower] = {}
        self._masters: list[MasterFollower] = []

    @property
    def counts(self) -> FileCounts:
        """Numbers of packets so far."""
        return self._file.counts

    @property
    def start_ns(self) -> int | None:
        """Time of the first packet since 1970 [ns]; None before it was read."""
        return self._file.start_ns

    @property
    def masters(self) -> tuple[MasterSummary, ...]:
        """The masters so far."""
        return tuple(_summary(each) for each in self._masters)

    def device(self, event: Event) -> Device | None:
        """Return the device of an event as far as it is known; None for all devices."""
        if event.device is None:
            return None
        return self._masters[event.master].devices[event.device].snapshot()

    def __iter__(self) -> Iterator[Event]:
        """Yield the events in the order in which they became known.

        Raises:
            DecodeError: The file is damaged before its first packet.
        """
        for pair in pair_frames(self._file):
            yield from self._master(pair).follow(pair)
        for master in self._masters:
            yield from master.flush(self.counts.packets)

    def _master(self, pair: FramePair) -> MasterFollower:
        found = self._by_source.get(pair.source)
        if found is None:
            found = self._by_source[pair.source] = MasterFollower(len(self._masters), pair)
            self._masters.append(found)
        return found


def read_timeline(path: str | os.PathLike[str]) -> Timeline:
    """Return the timeline of a capture, pcapng or pcap.

    Raises:
        DecodeError: The file is not a capture.
        OSError: The file cannot be read.
    """
    with open(path, "rb") as file:
        stream = EventStream(file.read)
        events: list[Event] = []
        complete = True
        for event in stream:
            if len(events) < MAXIMUM_EVENTS:
                events.append(event)
            else:
                complete = False
    return Timeline(tuple(events), stream.masters, stream.counts, complete)


def _summary(follower: MasterFollower) -> MasterSummary:
    clocks = {each.number: each.clock.statistics for each in follower.devices}
    return MasterSummary(
        follower.snapshot(),
        tuple(each.snapshot() for each in follower.devices),
        follower.cycles.statistics,
        {number: found for number, found in clocks.items() if found is not None},
        follower.reference.statistics,
    )

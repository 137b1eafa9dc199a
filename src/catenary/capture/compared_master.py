"""The master of a capture that is compared, with the bring-ups of its devices."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from catenary.capture.bring_up import BringUp, find_bring_up
from catenary.capture.contents import StateReached, StateRequest
from catenary.capture.difference import state_of
from catenary.capture.events import Device, Event
from catenary.capture.register_contents import (
    FmmuWrite,
    RegisterWrite,
    SyncManagerWrite,
    SyncUnitWrite,
)
from catenary.capture.timeline import MasterSummary, Timeline
from catenary.wire.al import AlState

_FOR_ALL = (  # broadcasts that configure every device
    *(StateRequest, StateReached, SyncManagerWrite, FmmuWrite, SyncUnitWrite, RegisterWrite),
)


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two captures. `start_up_ns` is None if no device reached a state."""

    summary: MasterSummary | None
    masters: int
    start_up_ns: int | None = None


class ComparedMaster:
    """Owner of the bring-ups of the master with most devices."""

    def __init__(self, timeline: Timeline) -> None:
        self._masters = timeline.masters
        self._summary = max(timeline.masters, key=lambda each: len(each.devices), default=None)
        self.devices: tuple[Device, ...] = self._summary.devices if self._summary else ()
        own: dict[int, list[tuple[int, Event]]] = defaultdict(list)
        common: list[tuple[int, Event]] = []
        number = self._summary.master.number if self._summary else None
        for place, event in enumerate(timeline.events):
            if event.master != number:
                continue
            if event.device is not None:
                own[event.device].append((place, event))
            elif isinstance(event.content, _FOR_ALL):
                common.append((place, event))
        self._bring_ups = {
            device.number: find_bring_up(
                [event for _, event in sorted(own[device.number] + common, key=lambda e: e[0])]
            )
            for device in self.devices
        }

    def bring_up(self, device: Device) -> BringUp:
        """Return the bring-up of a device."""
        return self._bring_ups[device.number]

    def states(self) -> Iterator[AlState]:
        """Yield the highest states of the devices."""
        for each in self._bring_ups.values():
            yield state_of(each.highest)

    def side(self) -> Side:
        """Return the summary."""
        ends = [each.ended_ns for each in self._bring_ups.values() if each.ended_ns is not None]
        took = max(ends) - self._summary.master.started_ns if ends and self._summary else None
        return Side(self._summary, len(self._masters), took)

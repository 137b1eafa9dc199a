"""Watch of the cables of a ring, by the counters of the two copies of each frame."""

from __future__ import annotations

from collections.abc import Callable

from catenary.bus.event_types import Event, LinkLost, LinkRestored
from catenary.bus.ring import Cuts, Ends, HasState, find_cuts, named


class RingWatch:
    """Watch of a ring's cables. It keeps those that were reported as cut.

    A change is reported when two consecutive checks find it. While a cable is being pulled, the
    counters of the copies belong to different times.
    """

    def __init__(
        self,
        ring: HasState,
        device_count: int,
        *,
        report: Callable[[Event], None],
        now: Callable[[], float],
    ) -> None:
        self._ring = ring
        self._device_count = device_count
        self._report = report
        self._now = now
        self._found: Cuts | None = None
        self._reported: tuple[Ends, ...] = ()

    def look(self) -> None:
        """Put an event for each cable that has changed."""
        found = find_cuts(self._ring.state, self._device_count)
        settled = found == self._found
        self._found = found
        if found is None or not settled:
            return
        for cable in self._reported:
            if cable not in found.cables:
                message = f"the cable between {named(cable)} carries frames again"
                self._report(LinkRestored(self._now(), None, message, cable))
        for cable in found.cables:
            if cable not in self._reported:
                message = f"the cable between {named(cable)} does not carry frames; {found}"
                self._report(LinkLost(self._now(), None, message, cable))
        self._reported = found.cables

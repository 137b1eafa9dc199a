"""Watch of duplicate frames, by counters of the core and of a ring.

A frame that returns a second time, in its cycle or later, is counted as repeated. Single ones occur
when a switch or a NIC repeats a frame. Many of them indicate a loop in the wiring or a second
sender. Late frames are not counted here, because they return once.
"""

from __future__ import annotations

from collections.abc import Callable

from catenary.bus.event_types import DuplicateFrames, Event
from catenary.procedure.exchange import Procedure, after

PERIOD = 1.0  # [s] between two readings of the counters
DUPLICATES_MIN = 10  # smallest number of frames in one period that puts an event
SILENCE = 60.0  # [s] between two events


class FrameWatch:
    """Watch of duplicate frames. It keeps the last count and the time of the last event."""

    def __init__(
        self,
        counted: Callable[[], int],
        *,
        put: Callable[[Event], None],
        now: Callable[[], float],
    ) -> None:
        self._counted = counted
        self._put = put
        self._now = now
        self._last_count = counted()
        self._last_time = now()
        self._reported: float | None = None  # [s]

    def run(self) -> Procedure[None]:
        """Read the counters once per period until cancelled."""
        while True:
            yield after(PERIOD)
            self.look()

    def look(self) -> None:
        """Put an event if enough frames were repeated since the last reading; see SILENCE."""
        now, count = self._now(), self._counted()
        repeated, interval = count - self._last_count, now - self._last_time
        self._last_count, self._last_time = count, now
        if repeated < DUPLICATES_MIN:
            return
        if self._reported is not None and now - self._reported < SILENCE:
            return
        self._reported = now
        message = (
            f"{repeated} frames in {interval:.1f} s returned more than once: check for a loop "
            "in the wiring or a second sender; Scheduling(exact_matching=True) rejects such frames"
        )
        self._put(DuplicateFrames(now, None, message, repeated, interval))

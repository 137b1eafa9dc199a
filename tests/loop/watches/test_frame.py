"""Watch of repeated frames, with a simulated counter."""

from __future__ import annotations

from catenary.bus.event_types import DuplicateFrames, Event
from catenary.loop.watches.frame import DUPLICATES_MIN, SILENCE, FrameWatch


class Bus:
    """Owner of a count, a time and the events."""

    def __init__(self) -> None:
        self.count = 7  # from before the loop
        self.time = 100.0
        self.events: list[Event] = []
        self.watch = FrameWatch(lambda: self.count, put=self.events.append, now=lambda: self.time)

    def after(self, seconds: float, repeated: int) -> list[Event]:
        self.time += seconds
        self.count += repeated
        self.watch.look()
        return self.events


def test_single_repeated_frames_raise_no_event() -> None:
    bus = Bus()
    for _ in range(100):
        assert bus.after(1.0, DUPLICATES_MIN - 1) == []


def test_many_repeated_frames_are_one_event_per_minute() -> None:
    bus = Bus()
    [event] = bus.after(1.0, DUPLICATES_MIN)
    assert isinstance(event, DuplicateFrames)
    assert (event.count, event.interval, event.sub) == (DUPLICATES_MIN, 1.0, None)
    assert "loop in the wiring or a second sender" in event.message
    for _ in range(round(SILENCE) - 1):
        assert len(bus.after(1.0, 1000)) == 1
    assert len(bus.after(1.0, 1000)) == 2

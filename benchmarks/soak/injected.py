"""Faults injected into a segment, from its log, and the devices that they isolate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import inf

from benchmarks.soak.effects import mends, out_of_reach
from catenary.virtual import Fault, Segment
from catenary.virtual import faults as f

KEPT = 60.0  # [s] for which a fault is kept after its end
MOMENTARY = (f.LeaveState, f.Join, f.Replug)


@dataclass(slots=True)
class Span:
    """A fault and its time span [s]."""

    fault: Fault
    begin: float
    end: float = inf


class Injected:
    """Owns the active and recent faults of one segment."""

    def __init__(self, segment: Segment) -> None:
        self._segment = segment
        self._seen = 0
        self._spans: list[Span] = []
        self._on: list[Span] = []
        self._isolated: dict[int, float] = {}  # device → start of its isolation [s]

    def update(self) -> None:
        """Read the new entries of the segment's log."""
        log = self._segment.fault_log
        for event in log[self._seen :]:
            if event.what == "begins":
                self._begin(event.fault, event.time)
            elif event.what == "ends":
                self._end(partial(_is_of, event.fault), event.time)
            self._isolate(event.time)
        self._seen = len(log)

    def _begin(self, fault: Fault, time: float) -> None:
        self._end(lambda span: mends(fault, span.fault), time)
        span = Span(fault, time, time if isinstance(fault, MOMENTARY) else inf)
        self._spans = [each for each in self._spans if each.end > time - KEPT]
        self._spans.append(span)
        if span.end == inf:
            self._on.append(span)

    def _end(self, which: Callable[[Span], bool], time: float) -> None:
        for span in self._on:
            if which(span):
                span.end = time
        self._on = [span for span in self._on if span.end == inf]

    def _isolate(self, time: float) -> None:
        """Update the isolated devices after a change at `time`."""
        isolated = out_of_reach([span.fault for span in self._on], ring=self._segment.ring)
        self._isolated = {device: self._isolated.get(device, time) for device in isolated}

    def between(self, start: float, end: float) -> Iterator[Fault]:
        """Yield the faults that were active in a time span, the latest first."""
        for span in reversed(self._spans):
            if span.begin <= end and span.end >= start:
                yield span.fault

    def isolated_since(self, device: int) -> float:
        """Return the time since which a device gets no outputs; infinity if it gets them."""
        return self._isolated.get(device, inf)


def _is_of(fault: Fault, span: Span) -> bool:
    return span.fault is fault

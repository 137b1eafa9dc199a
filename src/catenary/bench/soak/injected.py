"""What has been injected into a segment, as its own log tells it, and what was on when."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import inf

from catenary.bench.soak.effects import isolated, mends
from catenary.virtual import Fault, Segment
from catenary.virtual import faults as f

KEPT = 60.0  # [s] after its end
MOMENTARY = (f.LeaveState, f.Join, f.Replug)


@dataclass(slots=True)
class Span:
    """A fault and when it was on [s]."""

    fault: Fault
    begin: float
    end: float = inf


class Injected:
    """Owns the faults of one segment that are on, or were on not long ago."""

    def __init__(self, segment: Segment) -> None:
        self._segment = segment
        self._seen = 0
        self._spans: list[Span] = []
        self._on: list[Span] = []

    def update(self) -> None:
        """Takes what is new in the segment's log."""
        log = self._segment.fault_log
        for event in log[self._seen :]:
            if event.what == "begins":
                self._begin(event.fault, event.time)
            elif event.what == "ends":
                self._end(partial(_is_of, event.fault), event.time)
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

    def between(self, start: float, end: float) -> Iterator[Fault]:
        """Those that were on then, the latest first."""
        for span in reversed(self._spans):
            if span.begin <= end and span.end >= start:
                yield span.fault

    def isolated_since(self, device: int) -> float:
        """Since when no outputs reach it; infinity: they do."""
        return min(
            (
                span.begin
                for span in self._spans
                if span.end == inf and device in isolated(span.fault)
            ),
            default=inf,
        )


def _is_of(fault: Fault, span: Span) -> bool:
    return span.fault is fault

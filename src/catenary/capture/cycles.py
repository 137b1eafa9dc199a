"""Process data in a capture: layouts of cyclic frames, periods, working counters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from catenary.capture.contents import Content, CyclicStart, WorkingCounterBack, WorkingCounterDrop
from catenary.capture.pairing import FramePair
from catenary.capture.spread import RunningSpread, Spread
from catenary.wire.datagram import Datagram, EcatCommand

MAXIMUM_LAYOUTS = 64


class LogicalDatagram(NamedTuple):
    """Command, logical address and length of a datagram with process data."""

    command: EcatCommand
    address: int
    length: int

    def __str__(self) -> str:
        return f"{self.command.name} 0x{self.address:08X} ({self.length} bytes)"


@dataclass(frozen=True, slots=True)
class CycleStatistics:
    """Frames with one layout of logical datagrams. Times are in ns.

    `periods` are the times between sent frames. `latencies` are the times from a sent frame to its
    answer, on the clock of the capture. `working_counters` are the largest ones of the datagrams.
    """

    layout: tuple[LogicalDatagram, ...]
    frames: int
    lost: int
    started_ns: int
    ended_ns: int
    periods: Spread
    latencies: Spread
    working_counters: tuple[int, ...]
    drops: int  # frames with a smaller working counter than expected


class _Expectation:
    """Owner of the expected working counter of one datagram."""

    def __init__(self) -> None:
        self.expected = self.largest = 0
        self.low_frames = 0
        self.low_since_ns = 0

    def follow(self, datagram: LogicalDatagram, counter: int, time_ns: int) -> Content | None:
        self.largest = max(self.largest, counter)
        if counter < self.expected:
            self.low_frames += 1
            if self.low_frames > 1:
                return None
            self.low_since_ns = time_ns
            return WorkingCounterDrop(*datagram, self.expected, counter)
        frames, self.low_frames = self.low_frames, 0
        self.expected = counter
        if not frames:
            return None
        return WorkingCounterBack(*datagram, counter, frames, time_ns - self.low_since_ns)

    def forget(self) -> None:
        self.expected = self.low_frames = 0


class _Layout:
    """Owner of the statistics of one layout."""

    def __init__(self, layout: tuple[LogicalDatagram, ...], started_ns: int) -> None:
        self.layout = layout
        self.expectations = [_Expectation() for _ in layout]
        self.started_ns = started_ns
        self.last_ns: int | None = None
        self.frames = self.lost = self.drops = 0
        self.periods, self.latencies = RunningSpread(), RunningSpread()

    def statistics(self) -> CycleStatistics:
        return CycleStatistics(
            *(self.layout, self.frames, self.lost),
            *(self.started_ns, self.last_ns or self.started_ns),
            *(self.periods.spread, self.latencies.spread),
            tuple(each.largest for each in self.expectations),
            self.drops,
        )


class Cycles:
    """Owner of the layouts of one master's cyclic frames."""

    def __init__(self) -> None:
        self._layouts: dict[tuple[LogicalDatagram, ...], _Layout] = {}

    def follow(self, pair: FramePair) -> Iterator[Content]:
        """Follow a frame, and yield the changes of its working counters.

        Frames beyond `MAXIMUM_LAYOUTS` layouts are not counted.
        """
        base = pair.sent or pair.answer
        assert base is not None
        layout = tuple(_logical(each) for each in base.frame.datagrams if each.command.is_logical)
        if not layout:
            return
        found = self._layouts.get(layout)
        if found is None:
            if len(self._layouts) >= MAXIMUM_LAYOUTS:
                return
            found = self._layouts[layout] = _Layout(layout, base.time_ns)
            yield CyclicStart(len(self._layouts) - 1, ", ".join(map(str, layout)))
        found.frames += 1
        if found.last_ns is not None:
            found.periods.add(base.time_ns - found.last_ns)
        found.last_ns = base.time_ns
        yield from _answer(found, pair)

    def forget_expectations(self) -> None:
        """Expect no working counter, because the master has requested a lower state."""
        for layout in self._layouts.values():
            for each in layout.expectations:
                each.forget()

    @property
    def statistics(self) -> tuple[CycleStatistics, ...]:
        """Statistics of the layouts, in the order of their first frames."""
        return tuple(each.statistics() for each in self._layouts.values())


def _logical(datagram: Datagram) -> LogicalDatagram:
    return LogicalDatagram(datagram.command, datagram.address, len(datagram.data))


def _answer(found: _Layout, pair: FramePair) -> Iterator[Content]:
    if pair.answer is None:
        found.lost += 1
        return
    if pair.sent is not None:
        found.latencies.add(pair.answer.time_ns - pair.sent.time_ns)
    logical = [each for each in pair.answer.frame.datagrams if each.command.is_logical]
    dropped = False
    for key, expectation, datagram in zip(found.layout, found.expectations, logical, strict=True):
        content = expectation.follow(key, datagram.working_counter, pair.answer.time_ns)
        dropped |= expectation.low_frames > 0
        if content is not None:
            yield content
    found.drops += dropped

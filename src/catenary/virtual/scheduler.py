"""Delayed actions of the application side, ordered by due time and then by insertion."""

from __future__ import annotations

import heapq
import threading
from collections.abc import Callable
from itertools import count
from typing import Protocol

FOREVER = (1 << 63) - 1


class Clock(Protocol):
    @property
    def now(self) -> int: ...

    def wake_at(self, when: int) -> None: ...


class Agenda:
    """Delayed actions of a segment. Times are on its clock [ns]."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._heap: list[tuple[int, int, Callable[[], None]]] = []
        self._order = count()
        self.deferred = False  # True while a thread runs the service in real time
        self.lock = threading.RLock()  # held while the service runs

    @property
    def now(self) -> int:
        return self._clock.now

    @property
    def next_due(self) -> int:
        return self._heap[0][0] if self._heap else FOREVER

    def at(self, when_ns: int, action: Callable[[], None]) -> None:
        heapq.heappush(self._heap, (when_ns, next(self._order), action))
        self._clock.wake_at(when_ns)

    def after(self, delay_ns: int, action: Callable[[], None]) -> None:
        self.at(self._clock.now + delay_ns, action)

    def soon(self, action: Callable[[], None]) -> None:
        """Run an action that changes a device. Any thread may call it.

        In real time, the thread of the service runs it. In virtual time, it runs at once.
        """
        if self.deferred:
            self.after(0, action)
            return
        with self.lock:
            action()

    def run_due(self) -> None:
        """Run all actions that are due."""
        while self._heap and self._heap[0][0] <= self._clock.now:
            heapq.heappop(self._heap)[2]()


class Scheduler:
    """Delayed actions of one device. They are dropped when the device loses power."""

    def __init__(self, agenda: Agenda) -> None:
        self._agenda = agenda
        self._ended = False

    @property
    def now(self) -> int:
        return self._agenda.now

    def after(self, delay_ns: int, action: Callable[[], None]) -> None:
        self._agenda.after(delay_ns, lambda: None if self._ended else action())

    def end(self) -> None:
        self._ended = True

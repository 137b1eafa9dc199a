"""Events of a segment: a bounded queue for polling, and callbacks."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from catenary.bus.event_types import Event
from catenary.bus.thread_priority import step_behind

if TYPE_CHECKING:
    import logging

CAPACITY = 1000  # largest number of events that wait to be fetched
CLOSE_TIMEOUT = 1.0  # [s] for a running callback

Callback = Callable[[Event], object]


class LoopClock:
    """Zero of a loop's event times: the cycle start of its first iteration."""

    def __init__(self, zero_ns: Callable[[], int]) -> None:
        self._zero_ns = zero_ns  # returns a time of the link's clock; 0 before the first iteration

    def stamped(self, event: Event) -> Event:
        """Return the event with its time on the clock of `cycle.time`, if the zero is known."""
        zero = self._zero_ns()
        return replace(event, time=event.time - zero * 1e-9) if zero else event

    def freeze(self) -> None:
        """Keep the current zero, and drop the reference to the loop."""
        zero = self._zero_ns()
        self._zero_ns = lambda: zero


class Events:
    """Queue of the events that have not been fetched. Any thread may put and get.

        for event in main.events:                 # the pending events; never waits
            print(event)
        event = main.events.get(timeout=1.0)      # the next one, or None

    If events are not fetched, the oldest beyond `capacity` are dropped and counted in `dropped`.
    Writes of tools (`GatewayWrite`) are dropped before other events.
    Events are put with times of the link's clock. After the first iteration of a loop has begun,
    the events of this loop are fetched with times on the clock of `cycle.time`. Events of the
    start-up then have negative times.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self.dropped = 0
        self._pending: deque[tuple[Event, LoopClock | None]] = deque()
        self._clock: LoopClock | None = None  # of the open loop
        self._capacity = capacity
        self._changed = threading.Condition()
        self._listeners: tuple[Callable[[Event], None], ...] = ()

    def put(self, event: Event) -> None:
        """Add an event with a time of the link's clock, and call the listeners with it.

        If the queue is full, an event is dropped: the oldest one that gives way to others, or else
        the oldest one. The call never waits for space.
        """
        with self._changed:
            if len(self._pending) >= self._capacity:
                del self._pending[self._first_to_drop()]
                self.dropped += 1
            self._pending.append((event, self._clock))
            self._changed.notify()
            listeners = self._listeners
        for listener in listeners:
            listener(event)

    def _first_to_drop(self) -> int:
        pending = enumerate(self._pending)
        return next((rank for rank, (event, _) in pending if event.gives_way), 0)

    def get(self, timeout: float = 0.0) -> Event | None:
        """Remove and return the oldest event; None if no event arrives within `timeout`.

        Args:
            timeout: Longest wait [s], on the machine's clock even in virtual time.
        """
        deadline = time.monotonic() + timeout
        with self._changed:
            while not self._pending:
                left = deadline - time.monotonic()
                if left <= 0:
                    return None
                self._changed.wait(left)
            return _stamped(*self._pending.popleft())

    def __iter__(self) -> Iterator[Event]:
        """Remove and yield the pending events, oldest first."""
        while (event := self.get()) is not None:
            yield event

    def __len__(self) -> int:
        return len(self._pending)

    def begin_loop(self, zero_ns: Callable[[], int]) -> None:
        """Count the times of new events from the first iteration of a loop.

        Args:
            zero_ns: Function that returns the cycle start of that iteration [ns, link's clock]; 0
                before it.
        """
        self._clock = LoopClock(zero_ns)

    def end_loop(self) -> None:
        """Use the link's clock for new events. Pending events of the loop keep its clock."""
        if self._clock is not None:
            self._clock.freeze()
            self._clock = None

    def stamped(self, event: Event) -> Event:
        """Return a current event with its time on the clock of `cycle.time`, if a loop runs."""
        return _stamped(event, self._clock)

    def listen(self, listener: Callable[[Event], None]) -> Callable[[], None]:
        """Call `listener` with every event until the returned function is called.

        The listener runs in the thread that puts the event. Times are on the link's clock.
        """
        with self._changed:
            self._listeners = (*self._listeners, listener)

        def unsubscribe() -> None:
            with self._changed:
                self._listeners = tuple(each for each in self._listeners if each is not listener)

        return unsubscribe


def _stamped(event: Event, clock: LoopClock | None) -> Event:
    return event if clock is None else clock.stamped(event)


class Callbacks:
    """Callbacks of a MainDevice and, in real time, the thread that calls them.

    In virtual time, `deliver` calls them in the thread that advances the time. The order is
    therefore the same in every run. An exception of a callback is logged. The other callbacks
    still run.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self.in_thread = True
        self.dropped = 0  # events that were dropped because callbacks were slow
        self._callbacks: list[Callback] = []
        self._pending: queue.Queue[Event | None] = queue.Queue(capacity)  # None ends the thread
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._delivering = False

    def add(self, callback: Callback) -> None:
        self._callbacks.append(callback)

    def report(self, event: Event) -> None:
        """Queue an event for all callbacks; no effect without callbacks. Never waits for them.

        In real time, start the thread if it does not run. If the queue is full, the oldest event is
        dropped.
        """
        if not self._callbacks:
            return
        with self._lock:
            self._queue(event)
            if self.in_thread and self._thread is None:
                self._thread = threading.Thread(
                    target=self._serve, name="catenary events", daemon=True
                )
                self._thread.start()

    def deliver(self) -> None:
        """In virtual time, call the callbacks with the pending events.

        In real time, a thread calls them. No effect inside a callback.
        """
        if not self._callbacks or self.in_thread or self._delivering:
            return
        self._delivering = True
        try:
            while not self._pending.empty():
                self._call(self._pending.get_nowait())
        finally:
            self._delivering = False

    def close(self) -> None:
        """End the thread after the pending events. Wait at most CLOSE_TIMEOUT for its end.

        In virtual time, call the callbacks with the pending events.
        """
        self.deliver()
        with self._lock:
            thread, self._thread = self._thread, None
            if thread is not None:
                self._queue(None)
        if thread is not None and thread is not threading.current_thread():
            thread.join(CLOSE_TIMEOUT)

    def _queue(self, event: Event | None) -> None:
        while True:
            try:
                self._pending.put_nowait(event)
                return
            except queue.Full:
                self.dropped += 1
                with contextlib.suppress(queue.Empty):  # the thread has fetched the event
                    self._pending.get_nowait()

    def _serve(self) -> None:
        step_behind()
        while (event := self._pending.get()) is not None:
            self._call(event)

    def _call(self, event: Event | None) -> None:
        if event is None:
            return
        for callback in tuple(self._callbacks):
            try:
                callback(event)
            except Exception:  # an error in one callback must not stop the others
                _logger().exception(
                    "callback %r raised an exception for the event %s", callback, event
                )


def _logger() -> logging.Logger:
    import logging  # only needed after an error

    return logging.getLogger("catenary")

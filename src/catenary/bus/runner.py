"""Runner of procedures without a loop: all procedures at once, in shared frames.

It works in rounds. All pending requests are sent in as few frames as possible. When all frames have
returned or are lost, the procedures continue. A lost datagram is repeated only if its procedure
marked the request as repeatable. Every wait has a deadline on the link's clock.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, TypeVar

from catenary.bus.packing import (
    Parcel,
    batches,
    expected_replies,
    index_of,
    indices,
    make_parcel,
    replies_of,
)
from catenary.bus.pending import Pending
from catenary.bus.procedure_run import Task
from catenary.errors import DecodeError
from catenary.link import Link
from catenary.procedure.exchange import Procedure, Reply, Request
from catenary.wire.frame import decode_frame, is_alien

T = TypeVar("T")
Watch: TypeAlias = Callable[[], object]  # called in the thread that waits for a procedure

FRAME_TIMEOUT = 0.05  # [s]; a frame takes microseconds, scheduling on a busy machine much longer
ATTEMPTS = 4  # attempts of a repeatable request
BUSY_WAIT = 100e-6  # [s]; as long as a frame takes on a small segment, and a wake-up at most
GRID_NS = 50_000  # pauses end on this grid, so that procedures share frames
WINDOW = 16  # frames in flight; less than the capacity of any receive ring


class Runner(Protocol):
    """Interface to run a procedure to its end, or to start it and poll the result."""

    def run(self, procedure: Procedure[T], watch: Watch | None = None) -> T: ...

    def submit(self, procedure: Procedure[T]) -> Pending[T]: ...


@dataclass(slots=True)
class FrameCounts:
    """Frame counts of one runner."""

    sent: int = 0
    datagrams: int = 0
    lost: int = 0
    stale: int = 0  # EtherCAT frames that answer no pending request
    alien: int = 0  # other traffic
    malformed: int = 0


class LinkLent(RuntimeError):
    """Error of a call while a loop uses the link. Nothing was sent. Use the loop's runner."""


class BlockingRunner:
    """Runner that uses the link exclusively and blocks its caller until a procedure ends."""

    def __init__(
        self,
        link: Link,
        *,
        frame_timeout: float = FRAME_TIMEOUT,
        attempts: int = ATTEMPTS,
        busy_wait: float = 0.0,
    ) -> None:
        """Initialise the runner.

        Args:
            link: The link to the segment.
            frame_timeout: Time after which a frame is lost [s].
            attempts: Attempts of a repeatable request.
            busy_wait: Time for which the runner polls the link before it sleeps [s]. A frame
                returns sooner than a thread wakes up. 0 for links in virtual time.
        """
        self.counts = FrameCounts()
        self._link = link
        self._timeout_ns = round(frame_timeout * 1e9)
        self._attempts = attempts
        self._busy_ns = round(busy_wait * 1e9)
        self._indices = indices()
        self._lock = threading.Lock()
        self._lent = False

    def run(self, procedure: Procedure[T], watch: Watch | None = None) -> T:
        """Run a procedure to its end, and return its result or raise its error.

        Args:
            procedure: The procedure to run.
            watch: Function that is called after each exchange. It must not use the link.

        Raises:
            LinkLent: A loop uses the link.
        """
        return self.run_all([procedure], watch)[0]

    def submit(self, procedure: Procedure[T]) -> Pending[T]:
        """Run a procedure to its end, and return its handle, which has the result or the error.

        Raises:
            LinkLent: A loop uses the link.
        """
        pending = Pending(Task(procedure))
        with self._mine():
            try:
                self._run([pending.task])
            finally:
                pending.task.cancel()
                pending.finish()
        return pending

    def run_all(self, procedures: Sequence[Procedure[T]], watch: Watch | None = None) -> list[T]:
        """Run procedures at the same time, and return their results.

        If some fail, the others run to their ends. Then the first error is raised, with the other
        errors as notes.

        Args:
            procedures: The procedures to run.
            watch: Function that is called after each exchange. It must not use the link.

        Raises:
            LinkLent: A loop uses the link.
        """
        with self._mine():
            tasks = [Task(procedure) for procedure in procedures]
            try:
                self._run(tasks, watch)
            finally:
                for task in tasks:
                    task.cancel()
        errors = [task.error for task in tasks if task.error is not None]
        for other in errors[1:]:
            errors[0].add_note(f"also: {other}")
        if errors:
            raise errors[0]
        return [task.result() for task in tasks]

    def lend(self) -> None:
        """Wait for running procedures, then give the link to a loop and refuse new procedures."""
        with self._lock:
            self._lent = True

    def take_back(self) -> None:
        """Take the link back from a loop."""
        self._lent = False

    @contextlib.contextmanager
    def _mine(self) -> Iterator[None]:
        with self._lock:
            if self._lent:
                raise LinkLent("a loop uses the link: use the runner of the loop")
            yield

    def replace_link(self, link: Link) -> None:
        """Wait for running procedures, then use another link to the same segment."""
        with self._mine():
            self._link = link

    def flush(self) -> None:
        """Discard the received frames that are pending, and count them as stale."""
        while self._link.receive() is not None:
            self.counts.stale += 1

    def _run(self, tasks: Sequence[Task[Any]], watch: Watch | None = None) -> None:
        now = self._link.now()
        for task in tasks:
            task.start(now)
        while running := [task for task in tasks if not task.done]:
            ready = [task for task in running if task.requests]
            if not ready:
                due = min(task.wake_ns or 0 for task in running)
                self._sleep_until(due if len(running) == 1 else -(-due // GRID_NS) * GRID_NS)
            else:
                self._round(ready)
            self._wake(running)
            if watch is not None:
                watch()

    def _sleep_until(self, deadline_ns: int) -> None:
        before = None
        while (now := self._link.now()) < deadline_ns:
            if now == before:  # a clock that advances only while its user waits
                self._link.wait_until(deadline_ns, False)
            elif now < deadline_ns - self._busy_ns:
                self._link.wait_until(deadline_ns - self._busy_ns, False)
            before = now

    def _wake(self, tasks: Sequence[Task[Any]]) -> None:
        now = self._link.now()
        for task in tasks:
            if not task.done and task.wake_ns is not None and task.wake_ns <= now:
                task.resume([], now)

    def _round(self, ready: Sequence[Task[Any]]) -> None:
        requests = [request for task in ready for request in task.requests]
        replies = self._exchange(requests)
        now = self._link.now()
        start = 0
        for task in ready:
            end = start + len(task.requests)
            task.resume(replies[start:end], now)
            start = end

    def _exchange(self, requests: Sequence[Request]) -> list[Reply]:
        """Return all replies; repeat lost requests if they are repeatable."""
        replies: dict[int, Reply] = {}
        ranks = list(range(len(requests)))
        for _ in range(self._attempts):
            replies.update(self._send_once(requests, ranks))
            ranks = [r for r in ranks if replies[r].lost and requests[r].repeatable]
            if not ranks:
                break
        return [replies[rank] for rank in range(len(requests))]

    def _send_once(self, requests: Sequence[Request], ranks: Sequence[int]) -> dict[int, Reply]:
        replies: dict[int, Reply] = {}
        groups = [[ranks[i] for i in batch] for batch in batches([requests[r] for r in ranks])]
        for first in range(0, len(groups), WINDOW):
            under_way: dict[int, tuple[Parcel, list[int]]] = {}
            for group in groups[first : first + WINDOW]:
                parcel = make_parcel([requests[r] for r in group], next(self._indices))
                under_way[parcel.index] = (parcel, group)
                self._link.send(parcel.frame)
                self.counts.sent += 1
                self.counts.datagrams += len(group)
            self._collect(under_way, replies)
        return replies

    def _collect(
        self, under_way: dict[int, tuple[Parcel, list[int]]], replies: dict[int, Reply]
    ) -> None:
        """Receive the frames of one window, until a deadline. Missing frames count as lost."""
        start = self._link.now()
        busy_until, deadline = start + self._busy_ns, start + self._timeout_ns
        before = None
        # The deadline also ends a flood of frames.
        while under_way and (now := self._link.now()) < deadline:
            raw = self._link.receive()
            if raw is not None:
                self._take(raw, under_way, replies)
            elif now >= busy_until or now == before:  # see `_sleep_until`
                self._link.wait_until(deadline, True)
            before = now
        for _ in range(WINDOW):  # frames that arrived while this process did not run
            raw = self._link.receive() if under_way else None
            if raw is None:
                break
            self._take(raw, under_way, replies)
        now = self._link.now()
        for parcel, group in under_way.values():
            self.counts.lost += 1
            for rank, request in zip(group, parcel.requests, strict=True):
                replies[rank] = Reply(request.data, 0, True, now)

    def _take(
        self,
        raw: bytes,
        under_way: dict[int, tuple[Parcel, list[int]]],
        replies: dict[int, Reply],
    ) -> None:
        now = self._link.now()
        parcel, group = under_way.get(index_of(raw), (None, []))
        found = expected_replies(parcel, raw, now) if parcel else None
        if found is None:
            try:
                frame = decode_frame(raw)
            except DecodeError:
                self._count_stray(raw)
                return
            found = replies_of(parcel, frame, now) if parcel else None
        if parcel is None or found is None:
            self.counts.stale += 1
            return
        del under_way[parcel.index]
        replies.update(zip(group, found, strict=True))

    def _count_stray(self, raw: bytes) -> None:
        if is_alien(raw):
            self.counts.alien += 1
        else:
            self.counts.malformed += 1

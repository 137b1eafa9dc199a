"""Runner of procedures while a cycle runs, through the acyclic queue of the core.

`step` advances every procedure by at most one exchange. It is called at most once per cycle: by a
service thread, or in virtual time by the loop. Other threads submit procedures and wait.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

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
from catenary.bus.runner import ATTEMPTS, FRAME_TIMEOUT, FrameCounts, Watch
from catenary.errors import DecodeError, LoopError
from catenary.procedure.exchange import Procedure, Reply, Request
from catenary.wire.frame import decode_frame

T = TypeVar("T")

NEVER_NS = 1 << 62
FRAMES_PER_STEP = 4  # acyclic frames per cycle
WATCH_INTERVAL = 0.1  # [s] between two calls of `watch`


class AcyclicQueue(Protocol):
    """Interface to the acyclic queue; `core.Engine` implements it."""

    def acyclic_push(self, frame: bytes) -> bool: ...
    def acyclic_pop(self) -> bytes | None: ...
    def now(self) -> int: ...


@dataclass(slots=True, eq=False)
class _Turn:
    """Replies to one step of a task, collected until none is missing."""

    task: Task[Any]
    replies: list[Reply | None]


@dataclass(slots=True)
class _Item:
    """One request and its place in a step."""

    turn: _Turn
    rank: int
    request: Request
    attempts: int = 0


@dataclass(slots=True)
class _UnderWay:
    parcel: Parcel
    items: list[_Item]
    deadline_ns: int


class AcyclicRunner:
    """Runner of the procedures of an open loop. Only one thread may call `step`.

    Any thread may call `submit` and `run`. A pause that ends within `grain_ns` counts as ended,
    because its next frame is sent only with the next cycle.
    """

    def __init__(
        self,
        queue: AcyclicQueue,
        *,
        frame_timeout: float = FRAME_TIMEOUT,
        attempts: int = ATTEMPTS,
        grain_ns: int = 0,
    ) -> None:
        self.counts = FrameCounts()
        self.asked = threading.Event()  # set when a procedure is submitted
        self._queue = queue
        self._timeout_ns = round(frame_timeout * 1e9)
        self._attempts = attempts
        self._grain_ns = grain_ns
        self._indices = indices()
        self._lock = threading.Lock()  # for the two variables below
        self._submitted: deque[Pending[Any]] = deque()
        self._closed = False
        self._owner = threading.get_ident()
        self._active: list[Pending[Any]] = []
        self._outbox: deque[_Item] = deque()
        self._under_way: dict[int, _UnderWay] = {}

    def adopt(self) -> None:
        """Make the calling thread the loop's thread, which must not wait for results."""
        self._owner = threading.get_ident()

    def submit(self, procedure: Procedure[T]) -> Pending[T]:
        """Queue a procedure and return its handle. The procedure starts at the next step.

        Raises:
            LoopError: The loop has ended.
        """
        pending = Pending(Task(procedure))
        with self._lock:
            if self._closed:
                procedure.close()
                raise _ended()
            self._submitted.append(pending)
        self.asked.set()
        return pending

    def run(self, procedure: Procedure[T], watch: Watch | None = None) -> T:
        """Queue a procedure, wait for its end, and return its result or raise its error.

        Args:
            procedure: The procedure to run.
            watch: Function that is called every WATCH_INTERVAL while this call waits.

        Raises:
            RuntimeError: The caller is the loop's thread, which would deadlock.
            LoopError: The loop has ended, or ends during the wait.
        """
        if threading.get_ident() == self._owner:
            procedure.close()
            raise RuntimeError(
                "a blocking call in the loop's thread would stop the loop: use a request, such "
                "as sub.sdo.request(), and poll its `done`, or make the call in another thread or "
                "before the loop"
            )
        pending = self.submit(procedure)
        while not pending.wait(None if watch is None else WATCH_INTERVAL):
            if watch is not None:
                watch()
        if watch is not None:
            watch()
        return pending.result()

    @property
    def busy(self) -> bool:
        """True if procedures are active or submitted."""
        return bool(self._active or self._submitted)

    @property
    def due(self) -> bool:
        """True if a step has work now: a frame to send or to receive, or the end of a pause."""
        return self.next_due_ns <= self._queue.now()

    @property
    def next_due_ns(self) -> int:
        """Time of the next step with work [ns, the queue's clock].

        It is 0 while procedures or frames are pending. Otherwise, it is the end of the first pause
        minus `grain_ns`, or a time in the far future if there are no procedures.
        """
        if self._submitted or self._under_way or self._outbox:
            return 0
        wakes = [pending.task.wake_ns or 0 for pending in self._active]
        return min(wakes, default=NEVER_NS) - self._grain_ns

    def step(self) -> None:
        """Receive replies, advance each procedure by at most one exchange, and send new frames.

        Lost frames are sent again if they are repeatable. At most FRAMES_PER_STEP frames are sent.
        """
        now = self._queue.now()
        self._receive(now)
        self._expire(now)
        self._begin(now)
        self._wake(now)
        self._finish()
        self._send(now)

    def close(self) -> None:
        """End all procedures with LoopError, and refuse new ones."""
        with self._lock:
            self._closed = True
            left = [*self._active, *self._submitted]
            self._submitted.clear()
        self._active.clear()
        for pending in left:
            pending.finish(_ended())

    def _receive(self, now: int) -> None:
        while (raw := self._queue.acyclic_pop()) is not None:
            found = self._under_way.get(index_of(raw))
            replies = expected_replies(found.parcel, raw, now) if found else None
            if replies is None:
                try:
                    frame = decode_frame(raw)
                except DecodeError:
                    self.counts.malformed += 1
                    continue
                replies = replies_of(found.parcel, frame, now) if found else None
            if found is None or replies is None:
                self.counts.stale += 1
                continue
            del self._under_way[found.parcel.index]
            for item, reply in zip(found.items, replies, strict=True):
                self._deliver(item, reply, now)

    def _expire(self, now: int) -> None:
        late = [index for index, sent in self._under_way.items() if sent.deadline_ns <= now]
        for index in late:
            self.counts.lost += 1
            for item in self._under_way.pop(index).items:
                if item.request.repeatable and item.attempts < self._attempts:
                    self._outbox.append(item)
                else:
                    self._deliver(item, Reply(item.request.data, 0, True, now), now)

    def _deliver(self, item: _Item, reply: Reply, now: int) -> None:
        turn = item.turn
        turn.replies[item.rank] = reply
        complete = [reply for reply in turn.replies if reply is not None]
        if len(complete) == len(turn.replies) and not turn.task.done:
            turn.task.resume(complete, now)
            self._enqueue(turn.task)

    def _begin(self, now: int) -> None:
        with self._lock:
            begun = [pending for pending in self._submitted if not pending.cancelled]
            cancelled = [pending for pending in self._submitted if pending.cancelled]
            self._submitted.clear()
            self._active.extend(begun)
        for pending in cancelled:
            pending.task.cancel()
            pending.finish()
        for pending in begun:
            pending.task.start(now)
            self._enqueue(pending.task)

    def _wake(self, now: int) -> None:
        due = now + self._grain_ns
        for pending in self._active:
            task = pending.task
            if not task.done and task.wake_ns is not None and task.wake_ns <= due:
                task.resume([], now)
                self._enqueue(task)

    def _enqueue(self, task: Task[Any]) -> None:
        if task.done or not task.requests:
            return
        turn = _Turn(task, [None] * len(task.requests))
        self._outbox.extend(
            _Item(turn, rank, request) for rank, request in enumerate(task.requests)
        )

    def _finish(self) -> None:
        for pending in self._active:
            if pending.task.done:
                pending.finish()
        self._active = [pending for pending in self._active if not pending.task.done]

    def _send(self, now: int) -> None:
        items = list(self._outbox)
        sent = 0
        for batch in batches([item.request for item in items])[:FRAMES_PER_STEP]:
            group = [items[rank] for rank in batch]
            parcel = make_parcel([item.request for item in group], next(self._indices))
            if not self._queue.acyclic_push(parcel.frame):
                break
            for item in group:
                item.attempts += 1
            self._under_way[parcel.index] = _UnderWay(parcel, group, now + self._timeout_ns)
            self.counts.sent += 1
            self.counts.datagrams += len(group)
            sent += len(group)
        for _ in range(sent):
            self._outbox.popleft()


def _ended() -> LoopError:
    return LoopError(
        "the loop ended before the device answered", hint="repeat the call outside the loop"
    )

"""The conversations beside a running cycle, and who steps them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

from catenary.bus import LaneRunner, MainDevice
from catenary.bus.thread_priority import step_behind
from catenary.core import Engine
from catenary.errors import LoopError
from catenary.loop.mailbox_watch import MailboxWatch
from catenary.plan.planner import Plan
from catenary.procedure.exchange import Procedure

T = TypeVar("T")

BUSY_NS = 1_000_000  # between two steps, at most, while something is asked
IDLE = 0.010  # [s] between two looks at what nobody asks for


class Service:
    """Owns the lane of an engine and, in real time, the thread that steps it.

    In virtual time nobody else may run: the caller steps, between two cycles.
    """

    def __init__(self, main: MainDevice, engine: Engine, plan: Plan) -> None:
        self.runner = LaneRunner(engine, grain_ns=plan.cycle.period_ns // 2)
        self._watch = MailboxWatch(plan, main.subs, _mailbox_words(engine, plan), self.runner)
        self.cycle: Callable[[], int] = partial(engine.run, 1)  # one, with whoever shares the time
        self._main = main
        self._engine = engine
        self._quiet_until = 0  # [ns], in virtual time: nothing is due before
        self._ended = threading.Event()
        self._failure: Exception | None = None
        self._thread: threading.Thread | None = None
        if engine.scheduling != "virtual time":
            self._thread = threading.Thread(target=self._serve, name="catenary lane", daemon=True)

    def start(self) -> None:
        if self._thread is not None:
            self._thread.start()

    @property
    def beside(self) -> Callable[[], None] | None:
        """What the thread that iterates does before every cycle; None: nothing, a thread does."""
        return self.step if self._thread is None else None

    def step(self) -> None:
        """In virtual time: what the thread of real time does between two cycles. Mostly that is
        nothing, and then it takes next to no time."""
        now = self._engine.now()
        if now >= self._quiet_until or self.runner.asked.is_set() or self._watch.sees_mail:
            self.runner.asked.clear()
            self._watch.look(now, self._engine.number)
            if self.runner.due:
                self._engine.lane_wait(BUSY_NS)
                self.runner.step()
            self._quiet_until = min(self.runner.next_due_ns, self._watch.next_look_ns)
        self._main.deliver_events()

    def converse(self, *procedures: Procedure[T]) -> list[T]:
        """Runs conversations beside the cycle, all at once, from the thread that iterates: it
        keeps cycling without an application until the last one is answered."""
        tasks = [self.runner.submit(procedure) for procedure in procedures]
        while not all(task.done for task in tasks):
            self.cycle()
            if self._thread is None:
                self.step()
            elif not self._thread.is_alive():
                raise LoopError("the conversations beside the cycle have ended") from self._failure
        return [task.result() for task in tasks]

    def end(self) -> None:
        """Ends the thread; conversations left over get LoopError."""
        self._ended.set()
        self.runner.asked.set()
        if self._thread is not None and self._thread.is_alive():
            self._thread.join()
        self.runner.close()

    def _serve(self) -> None:
        step_behind()
        try:
            while not self._ended.is_set():
                self.runner.asked.clear()
                self._watch.look(self._engine.now(), self._engine.number)
                self.runner.step()
                if self.runner.due:
                    self._engine.lane_wait(BUSY_NS)
                else:
                    self.runner.asked.wait(IDLE)
        except Exception as failure:  # told by the next conversation: a thread has no caller
            self._failure = failure
            self.runner.close()


def _mailbox_words(engine: Engine, plan: Plan) -> Sequence[int]:
    """The last of the input integers."""
    integers = engine.buffers["input_integers"]
    words: Sequence[int] = integers[len(integers) - len(plan.mailboxes.columns) :]
    return words

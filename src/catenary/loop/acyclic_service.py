"""Execution of the acyclic queue while a cycle runs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeVar

from catenary.bus import AcyclicRunner, MainDevice
from catenary.bus.thread_priority import step_behind
from catenary.core import Engine
from catenary.errors import LoopError
from catenary.loop.watches.mailbox import MailboxWatch
from catenary.plan.planner import Plan
from catenary.procedure.exchange import Procedure

T = TypeVar("T")

BUSY_NS = 1_000_000  # longest time between two steps while a procedure is pending
IDLE = 0.010  # [s] between two checks of the mailboxes while no procedure is pending


class Service:
    """Acyclic runner of an engine and, in real time, the thread that steps it.

    In virtual time there is no such thread: the caller steps the queue between two cycles.
    """

    def __init__(self, main: MainDevice, engine: Engine, plan: Plan) -> None:
        self.runner = AcyclicRunner(engine, grain_ns=plan.cycle.period_ns // 2)
        self._watch = MailboxWatch(plan, main.subs, _mailbox_words(engine, plan), self.runner)
        self.cycle: Callable[[], int] = partial(engine.run, 1)  # the session replaces it
        self._main = main
        self._engine = engine
        self._quiet_until = 0  # [ns] no work before this time (virtual time)
        self._ended = threading.Event()
        self._failure: Exception | None = None
        self._thread: threading.Thread | None = None
        if engine.scheduling != "virtual time":
            self._thread = threading.Thread(
                target=self._serve, name="catenary acyclic", daemon=True
            )

    def start(self) -> None:
        """Start the service thread; a no-op in virtual time."""
        if self._thread is not None:
            self._thread.start()

    @property
    def beside(self) -> Callable[[], None] | None:
        """Function to call before every iterated cycle; None if there is a service thread."""
        return self.step if self._thread is None else None

    def step_without_thread(self) -> None:
        """Do the work of the service thread between two cycles, if there is no such thread."""
        if self._thread is None:
            self.step()

    def step(self) -> None:
        """Do the work of the service thread between two cycles, and deliver the events.

        This is for virtual time. Usually there is no work, and the call returns at once.
        """
        now = self._engine.now()
        if now >= self._quiet_until or self.runner.asked.is_set() or self._watch.sees_mail:
            self.runner.asked.clear()
            self._watch.look(now, self._engine.number)
            if self.runner.due:
                self._engine.acyclic_wait(BUSY_NS)
                self.runner.step()
            self._quiet_until = min(self.runner.next_due_ns, self._watch.next_look_ns)
        self._main.deliver_events()

    def converse(self, *procedures: Procedure[T]) -> list[T]:
        """Run procedures concurrently. Run cycles without the application until all have ended.

        Call this in the thread that iterates.

        Args:
            *procedures: Procedures to submit to the acyclic queue.

        Returns:
            Result of each procedure, in order.

        Raises:
            LoopError: The service thread has ended.
            CatenaryError: A procedure failed.
        """
        tasks = [self.runner.submit(procedure) for procedure in procedures]
        while not all(task.done for task in tasks):
            self.cycle()
            if self._thread is None:
                self.step()
            elif not self._thread.is_alive():
                raise LoopError(
                    "the thread of the acyclic queue ended with an error"
                ) from self._failure
        return [task.result() for task in tasks]

    def end(self) -> None:
        """End the thread and wait for it. Pending procedures fail with LoopError."""
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
                    self._engine.acyclic_wait(BUSY_NS)
                else:
                    self.runner.asked.wait(IDLE)
        except Exception as failure:  # a thread has no caller: a waiting `converse` reports it
            self._failure = failure
            self.runner.close()


def _mailbox_words(engine: Engine, plan: Plan) -> Sequence[int]:
    """Return the last input integers. Each of their bits shows if one mailbox is full."""
    integers = engine.buffers["input_integers"]
    words: Sequence[int] = integers[len(integers) - len(plan.mailboxes.columns) :]
    return words

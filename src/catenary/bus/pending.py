"""Pending: an answer that is still to come, to be looked at from inside a loop."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

from catenary.bus.procedure_run import Task
from catenary.errors import CatenaryError

T = TypeVar("T")


class Pending(Generic[T]):
    """Owns one conversation that was asked for and goes on beside the loop.

        answer = sub.sdo.request(0x6064, type=DINT)
        for cycle in loop:
            if answer.done:
                print(answer.result())

    Looking never waits and causes no traffic.
    """

    def __init__(self, task: Task[T]) -> None:
        self.task = task
        self._finished = threading.Event()
        self._cancelled = False

    @property
    def done(self) -> bool:
        """Whether there is a result, an error, or nobody wants either any more."""
        return self._cancelled or self._finished.is_set()

    @property
    def cancelled(self) -> bool:
        return self._cancelled

    @property
    def error(self) -> BaseException | None:
        """Why there is no result; None: there is, or not yet."""
        return self.task.error if self._finished.is_set() and not self._cancelled else None

    def result(self) -> T:
        """The answer, once `done`; raises what went wrong instead. RuntimeError before, and of a
        request that was cancelled."""
        if self._cancelled:
            raise RuntimeError("the request was cancelled")
        if not self._finished.is_set():
            raise RuntimeError("no answer yet: look at `done` first")
        return self.task.result()

    def cancel(self) -> None:
        """Nobody wants the answer any more. What has not begun never will; a transfer under way
        goes on to its end unseen, since a device must not be left in the middle of one."""
        self._cancelled = not self._finished.is_set()

    def wait(self) -> None:
        """Until it has ended, on another thread than the loop's."""
        self._finished.wait()  # the procedure's own deadlines, or the runner's close(), end this

    def finish(self, error: CatenaryError | None = None) -> None:
        """For the runner: the task has ended, or ends here with an error."""
        if error is not None and not self.task.done:
            self.task.cancel()
            self.task.error = error
        self._finished.set()

    def __repr__(self) -> str:
        state = "cancelled" if self._cancelled else "done" if self.done else "pending"
        return f"<Pending {state}>"

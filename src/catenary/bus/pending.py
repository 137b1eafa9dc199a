"""Pending: the future result of a procedure, for polling inside a loop."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

from catenary.bus.procedure_run import Task
from catenary.errors import CatenaryError

T = TypeVar("T")


class Pending(Generic[T]):
    """Handle of a procedure that runs while the loop runs.

        answer = sub.sdo.request(0x6064, type=DINT)
        for cycle in loop:
            if answer.done:
                print(answer.result())

    Polling never waits and causes no traffic.
    """

    def __init__(self, task: Task[T]) -> None:
        self.task = task
        self._finished = threading.Event()
        self._cancelled = False

    @property
    def done(self) -> bool:
        """True if there is a result or an error, or the procedure was cancelled."""
        return self._cancelled or self._finished.is_set()

    @property
    def cancelled(self) -> bool:
        return self._cancelled

    @property
    def error(self) -> BaseException | None:
        """Error of the procedure; None if it is running, succeeded or was cancelled."""
        return self.task.error if self._finished.is_set() and not self._cancelled else None

    def result(self) -> T:
        """Return the result, once `done`, or raise the error of the procedure.

        Raises:
            RuntimeError: The procedure has not ended, or was cancelled.
        """
        if self._cancelled:
            raise RuntimeError("the request was cancelled")
        if not self._finished.is_set():
            raise RuntimeError("no answer yet: check `done` first")
        return self.task.result()

    def cancel(self) -> None:
        """Discard the result. This has no effect once `done`.

        A procedure that has not started does not start. A transfer in progress continues to its
        end, because a device must not be left in the middle of one.
        """
        if not self._finished.is_set():
            self._cancelled = True

    def wait(self, seconds: float | None = None) -> bool:
        """Wait for the end, and return `done`. Do not call this in the loop's thread.

        Args:
            seconds: Longest time [s]; None: until the procedure ends.
        """
        # Without `seconds`, bounded by the procedure's deadlines and the runner's close().
        return self._finished.wait(seconds)

    def finish(self, error: CatenaryError | None = None) -> None:
        """Mark the procedure as ended, or end it with an error. The runner calls this."""
        if error is not None and not self.task.done:
            self.task.cancel()
            self.task.error = error
        self._finished.set()

    def __repr__(self) -> str:
        state = "cancelled" if self._cancelled else "done" if self.done else "pending"
        return f"<Pending {state}>"

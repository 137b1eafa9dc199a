"""Task: owns one procedure while it runs, whichever runner steps it."""

from __future__ import annotations

from typing import Generic, TypeVar, cast

from catenary.procedure.exchange import After, Procedure, Reply, Request

T = TypeVar("T")


class Task(Generic[T]):
    """Owns a procedure: what it waits for, and how it ended."""

    def __init__(self, procedure: Procedure[T]) -> None:
        self._procedure = procedure
        self.requests: list[Request] = []  # of this step; empty: none to send
        self.wake_ns: int | None = None  # sleeping until then
        self.done = False
        self.error: BaseException | None = None
        self._result: T | None = None

    def start(self, now_ns: int) -> None:
        """Runs to the first step."""
        self._advance(None, now_ns)

    def resume(self, replies: list[Reply], now_ns: int) -> None:
        """Hands over the replies of the last step (none after a pause) and runs to the next."""
        self._advance(replies, now_ns)

    def cancel(self) -> None:
        """Ends it where it stands; its `finally` clauses run, without the network."""
        if not self.done:
            self.done = True
            self._procedure.close()

    def result(self) -> T:
        """What it returned; raises what it raised."""
        if self.error is not None:
            raise self.error
        return cast(T, self._result)

    def _advance(self, replies: list[Reply] | None, now_ns: int) -> None:
        self.requests, self.wake_ns = [], None
        try:
            step = next(self._procedure) if replies is None else self._procedure.send(replies)
        except StopIteration as stop:
            self.done, self._result = True, stop.value
        except Exception as error:  # the procedure's verdict: its caller gets it from result()
            self.done, self.error = True, error
        else:
            if isinstance(step, After):
                self.wake_ns = now_ns + round(step.seconds * 1e9)
            else:
                self.requests = step
                self.wake_ns = None if step else now_ns  # nothing to send: due at once

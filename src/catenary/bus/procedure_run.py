"""Task: a running procedure, independent of its runner."""

from __future__ import annotations

from typing import Generic, TypeVar, cast

from catenary.procedure.exchange import After, Procedure, Reply, Request

T = TypeVar("T")


class Task(Generic[T]):
    """State of one procedure: its pending requests or pause, and its result."""

    def __init__(self, procedure: Procedure[T]) -> None:
        self._procedure = procedure
        self.requests: list[Request] = []  # requests of this step; may be empty
        self.wake_ns: int | None = None  # end of the pause; None: no pause
        self.done = False
        self.error: BaseException | None = None
        self._result: T | None = None

    def start(self, now_ns: int) -> None:
        """Run the procedure to its first step."""
        self._advance(None, now_ns)

    def resume(self, replies: list[Reply], now_ns: int) -> None:
        """Pass the replies of the last step to the procedure, and run it to the next step.

        Args:
            replies: Replies in the order of the requests; empty after a pause.
            now_ns: Time of the link's clock [ns].
        """
        self._advance(replies, now_ns)

    def cancel(self) -> None:
        """End the procedure. Its `finally` clauses run without network access."""
        if not self.done:
            self.done = True
            self._procedure.close()

    def result(self) -> T:
        """Return the result of the procedure, or raise its error."""
        if self.error is not None:
            raise self.error
        return cast(T, self._result)

    def _advance(self, replies: list[Reply] | None, now_ns: int) -> None:
        self.requests, self.wake_ns = [], None
        try:
            step = next(self._procedure) if replies is None else self._procedure.send(replies)
        except StopIteration as stop:
            self.done, self._result = True, stop.value
        except Exception as error:  # result() raises it in the caller of the procedure
            self.done, self.error = True, error
        else:
            if isinstance(step, After):
                self.wake_ns = now_ns + round(step.seconds * 1e9)
            else:
                self.requests = step
                self.wake_ns = None if step else now_ns  # nothing to send: resume at once

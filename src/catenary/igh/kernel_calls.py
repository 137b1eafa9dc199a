"""Beside: owns the threads that wait in the kernel for devices, so that nobody else waits there.

An object that is read or written by a call of its own (`ecrt_master_sdo_upload`) blocks until the
device has answered, in the kernel, where no signal reaches it. In a loop that is a thread's matter,
one for each device: the others, and the service of the loop, go on.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from catenary.errors import CatenaryError, MailboxError
from catenary.procedure.exchange import Procedure, after

T = TypeVar("T")

LOOK = 0.001  # [s] between two looks at a thread
BLOCKED_TIMEOUT = 30.0  # [s]; as long as cycles flow, the kernel gives a silent device up before
END_TIMEOUT = 2.0  # [s] for what is under way when the master is given back


class Call(Generic[T]):
    """Owns one call in a thread of its own, and what it returned or raised."""

    def __init__(self, call: Callable[[], T], what: str) -> None:
        self.what = what
        self._call = call
        self._results: list[T] = []
        self._error: Exception | None = None
        self.thread = threading.Thread(target=self._run, name=f"catenary {what}", daemon=True)
        self.thread.start()

    def _run(self) -> None:
        try:
            self._results.append(self._call())
        except Exception as error:  # raised again where it is waited for
            self._error = error

    @property
    def done(self) -> bool:
        return not self.thread.is_alive()

    def result(self) -> T:
        if self._error is not None:
            raise self._error
        return self._results[0]


class Beside:
    """Owns the calls under way, one for each device at most."""

    def __init__(self, timeout: float = BLOCKED_TIMEOUT) -> None:
        self.timeout = timeout
        self._under_way: dict[int, Call[object]] = {}

    def run(self, position: int, what: str, call: Callable[[], T]) -> Procedure[T]:
        """A conversation that waits for `call`, made in a thread. MailboxError where the kernel
        has not answered after `timeout`: the thread is left to it."""
        left = round(self.timeout / LOOK)
        while (before := self._under_way.get(position)) is not None and not before.done:
            yield after(LOOK)
            left -= 1
            if left < 0:
                raise self._late(position, what, f"the kernel is still busy with {before.what}")
        mine = Call(call, what)
        self._under_way[position] = mine  # type: ignore[assignment]  # whose result is not asked
        while not mine.done:
            yield after(LOOK)
            left -= 1
            if left < 0:
                raise self._late(position, what, "the kernel has not come back")
        return mine.result()

    def end(self) -> None:
        """Waits for what is under way: a master that is given back answers everything."""
        for call in self._under_way.values():
            call.thread.join(END_TIMEOUT)
        self._under_way.clear()

    def _late(self, position: int, what: str, why: str) -> CatenaryError:
        return MailboxError(
            f"device {position}: {what}: no answer within {self.timeout:g} s: {why}",
            hint="it answers only while cycles flow; dmesg | tail says what it waits for",
        )

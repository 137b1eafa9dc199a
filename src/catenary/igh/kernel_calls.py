"""Threads for calls that block in the kernel until a device answers.

Calls such as `ecrt_master_sdo_upload` block in the kernel, where no signal interrupts them. While
a loop runs, each device has its own thread for these calls. Other devices and the service of the
loop are not delayed.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from catenary.errors import CatenaryError, MailboxError
from catenary.procedure.exchange import Procedure, after

T = TypeVar("T")

POLL_INTERVAL = 0.001  # [s] between two checks of a thread
BLOCKED_TIMEOUT = 30.0  # [s]; while cycles run, the kernel's own timeout for a device is shorter
END_TIMEOUT = 2.0  # [s] for pending calls when the master is released


class Call(Generic[T]):
    """Call that runs in its own thread, and its result or exception."""

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
        except Exception as error:  # raised again in `result`
            self._error = error

    @property
    def done(self) -> bool:
        return not self.thread.is_alive()

    def result(self) -> T:
        if self._error is not None:
            raise self._error
        return self._results[0]


class BlockingCalls:
    """Pending calls, at most one for each device."""

    def __init__(self, timeout: float = BLOCKED_TIMEOUT) -> None:
        self.timeout = timeout
        self._under_way: dict[int, Call[object]] = {}

    def run(self, position: int, what: str, call: Callable[[], T]) -> Procedure[T]:
        """Run `call` in a thread, and wait for its result without blocking.

        Args:
            position: The position of the device.
            what: Name of the call in messages and of its thread.
            call: A call that may block.

        Returns:
            The result of `call`.

        Raises:
            MailboxError: The kernel did not answer within `timeout`. The thread keeps waiting.
        """
        left = round(self.timeout / POLL_INTERVAL)
        while (before := self._under_way.get(position)) is not None and not before.done:
            yield after(POLL_INTERVAL)
            left -= 1
            if left < 0:
                raise self._late(position, what, f"the kernel is still busy with {before.what}")
        mine = Call(call, what)
        self._under_way[position] = mine  # type: ignore[assignment]  # its result is not read
        while not mine.done:
            yield after(POLL_INTERVAL)
            left -= 1
            if left < 0:
                raise self._late(position, what, "the kernel has not returned")
        return mine.result()

    def end(self) -> None:
        """Wait up to END_TIMEOUT for each pending call. Forget those that do not end."""
        for call in self._under_way.values():
            call.thread.join(END_TIMEOUT)
        self._under_way.clear()

    def _late(self, position: int, what: str, why: str) -> CatenaryError:
        return MailboxError(
            f"device {position}: {what}: no answer within {self.timeout:g} s: {why}",
            hint="the master answers only while cycles run; dmesg | tail may show the reason",
        )

"""Workers: daemon threads that wait for devices, so that the thread of the sockets does not."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable

from catenary.bus.thread_priority import leave_real_time
from catenary.gateway.limits import CLIENTS, CLOSE_TIMEOUT


class Workers:
    """Owner of the threads. One is started for each task that finds no idle one."""

    def __init__(self) -> None:
        self._tasks: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        self._idle = threading.Semaphore(0)

    def submit(self, task: Callable[[], None]) -> None:
        """Call a function in a worker. It must not raise exceptions.

        Args:
            task: Function to call.
        """
        if not self._idle.acquire(blocking=False) and len(self._threads) < CLIENTS:
            thread = threading.Thread(target=self._work, name="catenary mailbox", daemon=True)
            self._threads.append(thread)
            thread.start()
        self._tasks.put(task)

    def close(self) -> None:
        """End the threads after the present tasks. Wait at most CLOSE_TIMEOUT for them."""
        for _ in self._threads:
            self._tasks.put(None)
        until = time.monotonic() + CLOSE_TIMEOUT
        for thread in self._threads:
            thread.join(max(until - time.monotonic(), 0.0))

    def _work(self) -> None:
        leave_real_time()
        while (task := self._tasks.get()) is not None:
            task()
            self._idle.release()

"""Supervisor: detect the end of each task and apply its failure policy.

The sentinel of a process becomes readable when the process ends, even after SIGKILL. One thread
starts and monitors all processes, because the kernel sends the parent-death signal when the thread
that started the process ends, prctl(2).
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Mapping
from multiprocessing import connection

from catenary.errors import TaskError
from catenary.realtime._task import FAILED
from catenary.realtime.handle import Handle
from catenary.realtime.worker import ProcessWorker, Worker

RESTARTS = 3  # maximum for each task; the next failure stops all tasks
KILL_SECONDS = 2.0  # longest wait after SIGTERM, and after SIGKILL


class Supervisor:
    """Owner of the workers of a set of tasks."""

    def __init__(
        self,
        handles: Mapping[str, Handle],
        make_worker: Callable[[Handle, Supervisor], Worker],
        on_failure: Callable[[], None],
    ) -> None:
        """Create the workers; `start` starts them.

        Args:
            handles: the tasks by name.
            make_worker: creates the worker of a task.
            on_failure: called after a failure that stops all tasks.
        """
        self._handles = handles
        self._make_worker = make_worker
        self._on_failure = on_failure
        self._lock = threading.Lock()
        self._all_ended = threading.Event()
        self._workers = {name: make_worker(handle, self) for name, handle in handles.items()}
        self._alive = set(handles)
        self._restarts = dict.fromkeys(handles, 0)
        self._overdue: set[str] = set()
        self._failures: list[TaskError] = []
        self._fatal: TaskError | None = None
        self._raised = False
        self._started = False
        self._stopping = False

    @property
    def failures(self) -> tuple[TaskError, ...]:
        return tuple(self._failures)

    def start(self) -> None:
        """Start all workers. For processes, the supervisor thread does this concurrently."""
        self._started = True
        if any(isinstance(worker, ProcessWorker) for worker in self._workers.values()):
            threading.Thread(target=self._monitor, name="task supervisor", daemon=True).start()
            return
        for name in self._workers:
            self._start(name)

    def wait(self, seconds: float | None) -> bool:
        """Wait until all tasks have ended. Return False after a timeout of `seconds`."""
        return self._all_ended.wait(seconds)

    def has_ended(self, name: str) -> bool:
        """Return True if a task has ended for the last time, and its failure is recorded."""
        return name not in self._alive

    def raise_failure(self) -> None:
        """Raise the failure that stopped all tasks, if any. Later calls do nothing."""
        if self._fatal is not None and not self._raised:
            self._raised = True
            raise self._fatal

    def thread_ended(self, name: str) -> None:
        """Record the end of a task's thread, and restart the task if its policy requires this.

        The thread calls this as its last action.
        """
        if self._record_end(name):
            self._start(name)

    def request_stop(self) -> None:
        """Request a stop: each task ends when it next waits."""
        self._stopping = True
        for handle in self._handles.values():
            handle.stop()

    def end(self, seconds: float) -> None:
        """Wait until all tasks have ended; kill the processes left after `seconds`.

        Each task left after `seconds` is a failure. Threads cannot be killed, so they continue. If
        no task was started, only remove the tasks from the clock.
        """
        if not self._started:
            for handle in self._handles.values():
                handle.leave()
            return
        ended = self._all_ended.wait(seconds)
        for number in (signal.SIGTERM, signal.SIGKILL):
            if not ended and self._kill(number, seconds):
                ended = self._all_ended.wait(KILL_SECONDS)

    def _kill(self, number: signal.Signals, seconds: float) -> bool:
        """Record the tasks that did not end, and send them a signal.

        Return False if some of them are threads, which cannot be killed.
        """
        with self._lock:
            alive = sorted(self._alive)
            for name in alive:
                if name not in self._overdue:
                    self._fail(overdue_error(self._handles[name], seconds))
            self._overdue.update(alive)
        return all([self._workers[name].kill(number) for name in alive])

    def _monitor(self) -> None:
        """Start the processes and wait until they end: the body of the supervisor thread."""
        to_start = list(self._workers)
        running: dict[int, str] = {}
        while to_start or running:
            for name in to_start:
                worker = self._start(name)
                if isinstance(worker, ProcessWorker):
                    running[worker.sentinel] = name
            to_start = []
            for ready in connection.wait(list(running)) if running else ():
                assert isinstance(ready, int)  # connection.wait returns the given sentinels
                name = running.pop(ready)
                if self._record_end(name):
                    to_start.append(name)

    def _start(self, name: str) -> Worker | None:
        """Start a worker and return it. If this fails, record the failure and return None."""
        worker = self._workers[name]
        try:
            worker.start()
        except Exception as error:  # the arguments cannot be pickled, or a system limit is reached
            block = self._handles[name].block
            block.failure = f"the task could not be started: {' '.join(str(error).split())}"
            block.state = FAILED
            self._record_end(name, may_restart=False)
            return None
        return worker

    def _record_end(self, name: str, *, may_restart: bool = True) -> bool:
        """Record the end of a task. Return True if the caller must start its new worker.

        If the failure policy of the task requires it, request the stop of all tasks.
        """
        handle = self._handles[name]
        with self._lock:
            failure = handle.failure(self._workers[name].wait())
            if failure is not None and name not in self._overdue:
                self._failures.append(failure)
                if may_restart and self._can_restart(handle):
                    self._restarts[name] += 1
                    handle.make_ready_again()
                    self._workers[name] = self._make_worker(handle, self)
                    return True
                if handle.task.on_failure != "continue":
                    self._fatal = self._fatal or failure
            self._alive.discard(name)
            handle.leave()
            last = not self._alive
        if self._fatal is not None and not self._stopping:
            self.request_stop()
            self._on_failure()
        if last:
            self._all_ended.set()
        return False

    def _can_restart(self, handle: Handle) -> bool:
        requested = handle.task.on_failure == "restart" and not self._stopping
        return requested and self._restarts[handle.name] < RESTARTS

    def _fail(self, failure: TaskError) -> None:
        self._failures.append(failure)
        self._fatal = self._fatal or failure


def overdue_error(handle: Handle, seconds: float) -> TaskError:
    return TaskError(
        f"{handle.task} did not end within {seconds:g} s after the stop request",
        task=handle.name,
        hint="a task detects a stop request only when it waits; use `for job in task`",
    )

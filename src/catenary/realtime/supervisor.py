"""Supervisor: notices when a task ends, by whatever way, and does what its policy says.

Processes are watched by their sentinels, which become readable when a process is gone, also by
SIGKILL. One thread starts and watches them: the signal that a process gets when its parent ends is
bound to the life of the thread that started it, prctl(2).
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

RESTARTS = 3  # of one task; the next failure stops all
KILL_SECONDS = 2.0  # from SIGTERM to SIGKILL, and from there to the end


class Supervisor:
    """Owns the workers of all tasks of a set."""

    def __init__(
        self,
        handles: Mapping[str, Handle],
        make_worker: Callable[[Handle, Supervisor], Worker],
        on_failure: Callable[[], None],
    ) -> None:
        """`on_failure` is called after a failure that stops all."""
        self._handles = handles
        self._make_worker = make_worker
        self._on_failure = on_failure
        self._lock = threading.Lock()
        self._all_ended = threading.Event()
        self._workers = {name: make_worker(handle, self) for name, handle in handles.items()}
        self._alive = set(handles)
        self._restarts = dict.fromkeys(handles, 0)
        self._stubborn: set[str] = set()
        self._failures: list[TaskError] = []
        self._fatal: TaskError | None = None
        self._raised = False
        self._started = False
        self._stopping = False

    @property
    def failures(self) -> tuple[TaskError, ...]:
        return tuple(self._failures)

    def start(self) -> None:
        """Starts all workers."""
        self._started = True
        if any(isinstance(worker, ProcessWorker) for worker in self._workers.values()):
            threading.Thread(target=self._watch, name="task supervisor", daemon=True).start()
            return
        for name in self._workers:
            self._start(name)

    def wait(self, seconds: float | None) -> bool:
        """True: all have ended."""
        return self._all_ended.wait(seconds)

    def raise_failure(self) -> None:
        """What stopped all tasks, if something did: once."""
        if self._fatal is not None and not self._raised:
            self._raised = True
            raise self._fatal

    def thread_ended(self, name: str) -> None:
        """Called by a task's thread, last of all."""
        if self._take_note(name):
            self._start(name)

    def ask_to_stop(self) -> None:
        """Every task ends when it next waits."""
        self._stopping = True
        for handle in self._handles.values():
            handle.stop()

    def end(self, seconds: float) -> None:
        """Waits for the ends of all tasks, and brings those about that have not come after
        `seconds`."""
        if not self._started:
            for handle in self._handles.values():
                handle.leave()
            return
        ended = self._all_ended.wait(seconds)
        for number in (signal.SIGTERM, signal.SIGKILL):
            if not ended and self._kill(number, seconds):
                ended = self._all_ended.wait(KILL_SECONDS)

    def _kill(self, number: signal.Signals, seconds: float) -> bool:
        """Notes who would not end. False: threads are among them, which nothing ends."""
        with self._lock:
            alive = sorted(self._alive)
            for name in alive:
                if name not in self._stubborn:
                    self._fail(would_not_end(self._handles[name], seconds))
            self._stubborn.update(alive)
        return all([self._workers[name].kill(number) for name in alive])

    def _watch(self) -> None:
        """The thread that starts processes and waits for their ends."""
        to_start = list(self._workers)
        running: dict[int, str] = {}
        while to_start or running:
            for name in to_start:
                worker = self._start(name)
                if isinstance(worker, ProcessWorker):
                    running[worker.sentinel] = name
            to_start = []
            for ready in connection.wait(list(running)) if running else ():
                assert isinstance(ready, int)  # it was one of the sentinels
                name = running.pop(ready)
                if self._take_note(name):
                    to_start.append(name)

    def _start(self, name: str) -> Worker | None:
        """None: it could not be started, and that was noted."""
        worker = self._workers[name]
        try:
            worker.start()
        except Exception as error:  # of pickling the user's arguments, or of the system's limits
            block = self._handles[name].block
            block.failure = f"it could not be started: {' '.join(str(error).split())}"
            block.state = FAILED
            self._take_note(name, may_restart=False)
            return None
        return worker

    def _take_note(self, name: str, *, may_restart: bool = True) -> bool:
        """A task has ended. True: its new worker is to be started."""
        handle = self._handles[name]
        with self._lock:
            failure = handle.failure(self._workers[name].wait())
            if failure is not None and name not in self._stubborn:
                self._failures.append(failure)
                if may_restart and self._wants_restart(handle):
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
            self.ask_to_stop()
            self._on_failure()
        if last:
            self._all_ended.set()
        return False

    def _wants_restart(self, handle: Handle) -> bool:
        wanted = handle.task.on_failure == "restart" and not self._stopping
        return wanted and self._restarts[handle.name] < RESTARTS

    def _fail(self, failure: TaskError) -> None:
        self._failures.append(failure)
        self._fatal = self._fatal or failure


def would_not_end(handle: Handle, seconds: float) -> TaskError:
    return TaskError(
        f"{handle.task} did not end within {seconds:g} s of being asked to",
        task=handle.name,
        hint="a task sees that it is to end when it waits: `for job in task`",
    )

"""Tasks: a set of tasks that run together, from their common start to their end.

By default, several tasks run in one process each. With a shared interpreter lock, a task of low
priority would delay one of high priority by up to 5 ms at every switch.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from types import TracebackType
from typing import Self, TypeVar

from catenary.errors import TaskError
from catenary.realtime._task import FAILED, NEW
from catenary.realtime.analysis import Demand, Verdict, analyse
from catenary.realtime.clock import VirtualClock
from catenary.realtime.handle import Handle
from catenary.realtime.statistics import as_table, measured_demand
from catenary.realtime.supervisor import Supervisor
from catenary.realtime.system import libc
from catenary.realtime.system.preparation import Session
from catenary.realtime.task import Task
from catenary.realtime.task_main import START_SECONDS, Work
from catenary.realtime.worker import ProcessWorker, ThreadWorker, Worker, Workers, check_importable

LEAD_SECONDS = 0.01  # from the last task's start to the first release of all
STOP_SECONDS = 5.0
CHECK_NS = 1_000_000_000  # [ns] of virtual time between two checks

T = TypeVar("T")


class Tasks:
    """A set of tasks that run together.

    `with Tasks(a, b) as tasks:` starts them together, and stops them at the end of the block.
    `tasks["a"]` is the handle of one task. `print(tasks)` shows the statistics of all jobs.

    Args:
        tasks: Tasks to run.
        workers: "processes" or "threads"; None selects processes for more than one task.
        clock: VirtualClock that simulates the tasks by priority and processor. A `cpu` of None
            counts as 0. None for real time.
        session: `realtime.session()` to enter in each process; for threads, in this process. None
            to change no settings of the process.
        best_effort: True to continue without refused priorities and processors.

    Raises:
        TypeError: An object is not a Task.
        ValueError: There are no tasks, two have the same name or trigger, `workers` is invalid, or
            a processor does not exist.
    """

    def __init__(
        self,
        *tasks: Task,
        workers: Workers | None = None,
        clock: VirtualClock | None = None,
        session: Session | None = None,
        best_effort: bool = False,
    ) -> None:
        check_set(tasks, workers)
        if clock is None:
            check_cpus(tasks)
        self.workers: Workers = workers or ("processes" if len(tasks) > 1 else "threads")
        self._tasks = tasks
        self._clock = clock
        self._session = session
        self._best_effort = best_effort
        self._handles: Mapping[str, Handle] = {}
        self._supervisor: Supervisor | None = None
        self._undo = contextlib.ExitStack()  # undoes the changes to this process

    def __getitem__(self, name: str) -> Handle:
        if name not in self._handles:
            known = ", ".join(self._handles) or "none"
            raise KeyError(f"unknown task {name!r}; started tasks: {known}")
        return self._handles[name]

    def __iter__(self) -> Iterator[Handle]:
        return iter(self._handles.values())

    def __len__(self) -> int:
        return len(self._tasks)

    @property
    def failures(self) -> tuple[TaskError, ...]:
        """Failures so far, oldest first, including those of restarted or abandoned tasks."""
        return self._supervisor.failures if self._supervisor else ()

    def start(self) -> None:
        """Start all tasks, wait until all have started, and release their first jobs together.

        If this fails, all tasks are stopped.

        Raises:
            TaskError: A task failed, or did not start within 60 s.
            RealtimeError: The session was refused in this process.
            RuntimeError: The tasks have already been started.
            TypeError: A new process cannot import the function of a task.
            ValueError: The virtual clock has too many participants.
        """
        if self._supervisor is not None:
            raise RuntimeError("these tasks have already been started")
        if self.workers == "processes":
            for task in self._tasks:
                check_importable(task)
        self._handles = make_handles(self._tasks, self._clock)
        for handle in self:
            if handle.task.trigger is not None:
                handle.task.trigger.bind(handle.place)
        self._supervisor = Supervisor(self._handles, self._make_worker, self._wake_clock)
        try:
            if self.workers == "threads" and self._session is not None:
                self._undo.enter_context(self._session)
            if self._clock is not None:
                share_one_cpu(self._undo)
            self._supervisor.start()
            self._wait_for_all()
        except BaseException:
            self.stop(raising=False)
            raise
        origin = self._now_ns() + (0 if self._clock else round(LEAD_SECONDS * 1e9))
        for handle in self:
            handle.block.start_at(origin)

    def join(self, seconds: float | None = None) -> bool:
        """Wait until all tasks have ended. On a virtual clock, time passes during this call.

        Args:
            seconds: timeout on the tasks' clock [s]; None for no timeout.

        Returns:
            True if all tasks have ended.

        Raises:
            TaskError: the failure of a task stopped all tasks.
            RuntimeError: the tasks have not been started.
        """
        supervisor = self._started()
        if self._clock is None:
            ended = supervisor.wait(seconds)
        elif seconds is None:
            self._clock.home.step_aside()
            ended = supervisor.wait(None)
            self._clock.home.return_to()
        else:
            self._clock.wait_until(self._clock.now_ns + round(seconds * 1e9))
            ended = supervisor.wait(0.0)
        supervisor.raise_failure()
        return ended

    def stop(self, seconds: float = STOP_SECONDS, *, raising: bool = True) -> None:
        """Stop all tasks, and wait for their end. Each task ends when it next waits.

        Then undo the changes to this process: the session and the processor binding.

        Args:
            seconds: timeout [s]; after it, processes receive SIGTERM, then SIGKILL. Threads
                continue.
            raising: raise the failure that stopped the tasks.

        Raises:
            TaskError: the failure of a task stopped all tasks, or a task did not end in time.
            RuntimeError: the tasks have not been started.
        """
        supervisor = self._started()
        supervisor.request_stop()
        if self._clock is not None:
            self._clock.home.step_aside()
        try:
            supervisor.end(seconds)
        finally:
            self._undo.close()
            if self._clock is not None:
                self._clock.home.return_to()
        if raising:
            supervisor.raise_failure()

    def beside(
        self,
        function: Callable[..., T],
        *arguments: object,
        priority: int = 0,
        cpu: int | None = None,
    ) -> T:
        """Run `function(place, *arguments)` in parallel with the tasks, and return its result.

        On the machine's clock, the function runs in this thread, and `place` is None. If the tasks
        are processes, this process also enters the session. On a virtual clock, the function runs
        in its own thread while time passes, and `place` is its participant
        (`Segment(..., clock=place)`). Ctrl-C then takes effect after the function has ended,
        because a thread cannot be killed.

        Args:
            function: the function to run. Its exceptions propagate.
            arguments: further arguments of the function.
            priority: priority on the virtual clock.
            cpu: simulated processor on the virtual clock; None for its own.

        Returns:
            The result of the function.

        Raises:
            TaskError: the failure of a task stopped all tasks. `failures` contains it as soon as it
                occurs.
            RuntimeError: the tasks have not been started.
        """
        supervisor = self._started()
        if self._clock is not None:
            result = run_at(self._clock, priority, cpu, function, arguments)
        else:
            with self._own_session():
                result = function(None, *arguments)
        supervisor.raise_failure()
        return result

    def verdict(self, *others: Demand) -> Verdict:
        """Analyse these tasks with their longest execution times measured so far.

        `others` are additional demands on the processors, for example a loop. Raises ValueError if
        a task has not ended a job yet, or if only some of the demands have a processor.
        """
        measured = [measured_demand(handle.task, handle.statistics) for handle in self]
        return analyse([*measured, *others])

    def __str__(self) -> str:
        return as_table(handle.statistics for handle in self)

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop(raising=error is None)

    def _own_session(self) -> contextlib.AbstractContextManager[object]:
        """Return the session if the tasks are processes, otherwise a null context."""
        if self._session is None or self.workers == "threads":
            return contextlib.nullcontext()
        return self._session

    def _started(self) -> Supervisor:
        if self._supervisor is None:
            raise RuntimeError("these tasks have not been started: use `with Tasks(...)`")
        return self._supervisor

    def _make_worker(self, handle: Handle, supervisor: Supervisor) -> Worker:
        work = Work(handle.task, handle.place, self._best_effort)
        if self.workers == "threads":
            return ThreadWorker(work, supervisor.thread_ended)
        return ProcessWorker(work, self._session)

    def _wait_for_all(self) -> None:
        deadline = time.monotonic_ns() + round(START_SECONDS * 1e9)
        for handle in self:
            while self._is_starting(handle) and time.monotonic_ns() < deadline:
                handle.block.wait_while(handle.block.state, time.monotonic_ns() + 50_000_000)
                self._started().raise_failure()
            if handle.block.state == NEW:
                raise TaskError(
                    f"{handle.task} did not start within {START_SECONDS:g} s", task=handle.name
                )
        self._started().raise_failure()

    def _is_starting(self, handle: Handle) -> bool:
        """Return True until the task runs, or the supervisor has recorded its failure."""
        if handle.block.state == FAILED:
            return not self._started().has_ended(handle.name)
        return handle.block.state == NEW

    def _now_ns(self) -> int:
        return time.monotonic_ns() if self._clock is None else self._clock.now_ns

    def _wake_clock(self) -> None:
        """Wake the thread of the clock, so that a failure ends `join`."""
        if self._clock is not None:
            self._clock.home.wake()


def run_at(
    clock: VirtualClock,
    priority: int,
    cpu: int | None,
    function: Callable[..., T],
    arguments: tuple[object, ...],
) -> T:
    """Run the function in its own thread while virtual time passes; return its result."""
    place = clock.participate(priority=priority, cpu=cpu)

    def work() -> T:
        try:
            return function(place, *arguments)
        finally:
            place.leave()

    with ThreadPoolExecutor(1, "beside tasks") as pool:
        future = pool.submit(work)
        future.add_done_callback(lambda _: clock.home.wake())
        try:
            while not future.done():
                clock.wait_until(clock.now_ns + CHECK_NS)
        except BaseException:  # Ctrl-C: let time pass, so that the function can end
            clock.home.step_aside()
            wait([future])
            clock.home.return_to()
            raise
    return future.result()


def share_one_cpu(undo: contextlib.ExitStack) -> None:
    """Bind this thread, and the threads and processes that it starts, to one processor.

    On a virtual clock, only one of them runs at a time. A switch on one processor takes 8 us, and a
    switch to another processor takes 18 us.
    """
    thread = threading.get_native_id()
    undo.callback(os.sched_setaffinity, thread, os.sched_getaffinity(thread))
    os.sched_setaffinity(thread, {libc.call("sched_getcpu")})


def check_set(tasks: tuple[Task, ...], workers: Workers | None) -> None:
    if not tasks:
        raise ValueError("no tasks given; use Tasks(task, ...)")
    for task in tasks:
        if not isinstance(task, Task):
            raise TypeError(f"{task!r} is not a Task; use Task(function, period=...)")
    names = [task.name for task in tasks]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"two tasks have the name {name!r}; give each task a different `name`")
    triggers = [task.trigger for task in tasks if task.trigger is not None]
    if len(set(map(id, triggers))) < len(triggers):
        raise ValueError("two tasks have the same trigger, but a Signal releases only one task")
    if workers not in (None, "processes", "threads"):
        raise ValueError(f'workers must be "processes" or "threads", not {workers!r}')


def make_handles(tasks: tuple[Task, ...], clock: VirtualClock | None) -> dict[str, Handle]:
    """Create the handles. If one fails, remove the others: a virtual clock would wait for them."""
    handles: dict[str, Handle] = {}
    try:
        for task in tasks:
            handles[task.name] = Handle(task, clock)
    except BaseException:
        for handle in handles.values():
            handle.leave()
        raise
    return handles


def check_cpus(tasks: tuple[Task, ...]) -> None:
    allowed = os.sched_getaffinity(0)
    for task in tasks:
        if task.cpu is not None and task.cpu not in allowed and not may_have(task.cpu, allowed):
            raise ValueError(
                f"{task}: CPU {task.cpu} does not exist or is not allowed; this process may use "
                + ", ".join(map(str, sorted(allowed)))
            )


def may_have(cpu: int, allowed: set[int]) -> bool:
    """Return True if the process may use `cpu`, even if it is isolated (isolcpus)."""
    thread = threading.get_native_id()
    try:
        os.sched_setaffinity(thread, {cpu})
    except OSError:
        return False
    os.sched_setaffinity(thread, allowed)
    return True

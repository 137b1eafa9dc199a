"""Workers: a common interface to the threads and processes that tasks run in."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
from collections.abc import Callable
from multiprocessing.context import SpawnProcess
from typing import Literal, Protocol, TypeAlias

from catenary.realtime.system.preparation import Session
from catenary.realtime.task import Task
from catenary.realtime.task_main import Work, run_in_process, start_thread

Workers: TypeAlias = Literal["processes", "threads"]


class Worker(Protocol):
    """Owner of the thread or process of one task."""

    def start(self) -> None: ...

    def wait(self) -> int | None:
        """Join the worker, which has already ended.

        Return its exit status, negative for the signal that killed it. Return None for a thread,
        or for a process that was never started.
        """

    def kill(self, number: signal.Signals) -> bool:
        """Send a signal. Return False if the worker cannot be killed."""


class ProcessWorker:
    """Worker in its own process, started with `spawn` so that it has its own interpreter."""

    def __init__(self, work: Work, session: Session | None) -> None:
        arguments = (work, session, os.getpid())
        self._process: SpawnProcess = multiprocessing.get_context("spawn").Process(
            target=run_in_process, args=arguments, name=work.task.name, daemon=True
        )

    @property
    def sentinel(self) -> int:
        """File descriptor that becomes readable when the process ends."""
        return self._process.sentinel

    def start(self) -> None:
        self._process.start()

    def wait(self) -> int | None:
        if self._process.pid is None:
            return None  # never started
        self._process.join()
        return self._process.exitcode

    def kill(self, number: signal.Signals) -> bool:
        if self._process.pid is not None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process.pid, number)
        return True


class ThreadWorker:
    """Worker in a thread of this process. The interpreter runs one thread at a time."""

    def __init__(self, work: Work, ended: Callable[[str], None]) -> None:
        self._work = work
        self._ended = ended

    def start(self) -> None:
        start_thread(self._work, self._ended)

    def wait(self) -> int | None:
        return None

    def kill(self, number: signal.Signals) -> bool:
        return False


def check_importable(task: Task) -> None:
    """Check that a new process can import the task's functions. Raises TypeError if it cannot."""
    functions = (task.function, task.on_miss)
    for function in filter(callable, functions):
        try:
            pickle.dumps(function)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise TypeError(
                f"{task}: its process cannot import {function!r}: {error}. Define the function at "
                'the top level of a module, or use workers="threads"'
            ) from error

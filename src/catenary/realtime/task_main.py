"""A task from its first instruction to its last, in its own thread or process."""

from __future__ import annotations

import contextlib
import gc
import os
import resource
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from catenary.errors import CatenaryError, RealtimeError
from catenary.realtime import libc
from catenary.realtime._stack import touch_stack
from catenary.realtime._task import ENDED, FAILED, STARTED, Block, Releases
from catenary.realtime.preparation import SET_CAPABILITIES, Session
from catenary.realtime.running_task import Running
from catenary.realtime.scheduling import Scheduling, refusal, what_scheduling
from catenary.realtime.task import Task
from catenary.realtime.task_memory import Place

START_SECONDS = 60.0  # at most, from one task's start to that of all
STACK_LEFT = 32 * 1024  # [bytes] not touched: what runs already lies there


@dataclass(frozen=True, slots=True)
class Work:
    """What a worker is handed."""

    task: Task
    place: Place
    best_effort: bool


def run_in_process(work: Work, session: Session | None, parent: int) -> None:
    """The main function of a task's process. Exit status 1: it failed, and its block says why."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is the parent's, who then stops us
    signal.signal(signal.SIGTERM, end_now)
    libc.signal_on_parents_death(signal.SIGTERM)
    if os.getppid() != parent:
        sys.exit("the parent process has ended")
    if work.task.stack_size is not None:
        _, most = resource.getrlimit(resource.RLIMIT_STACK)
        resource.setrlimit(resource.RLIMIT_STACK, (work.task.stack_size, most))
    with session or contextlib.nullcontext():
        failed = not run(work)
    sys.exit(1 if failed else 0)


def end_now(number: int, frame: object) -> None:
    """SIGTERM: our parent has ended or lost patience. `finally` blocks still run."""
    sys.exit(128 + number)


def start_thread(work: Work, ended: Callable[[str], None]) -> threading.Thread:
    """The task in a thread of its own, which calls `ended` last."""

    def body() -> None:
        run(work)
        ended(work.task.name)

    thread = threading.Thread(target=body, name=work.task.name, daemon=True)
    with stack_size(work.task.stack_size):
        thread.start()
    return thread


@contextlib.contextmanager
def stack_size(size: int | None) -> Iterator[None]:
    """Of threads that are started meanwhile; Python has one setting for all."""
    if size is None:
        yield
        return
    before = threading.stack_size(size)
    try:
        yield
    finally:
        threading.stack_size(before)


def run(work: Work) -> bool:
    """False: it failed, and its block says why."""
    block = Block(work.place.memory.buffer)
    try:
        block.scheduling = prepare(work)
        block.process = os.getpid()
        block.state = STARTED
        if not block.wait_for_start(time.monotonic_ns() + round(START_SECONDS * 1e9)):
            raise RealtimeError(f"the other tasks did not start within {START_SECONDS} s")
        iterate(work, block)
    except Exception as error:
        block.failure = reason(error)
        block.state = FAILED
        return False
    finally:
        leave_priority()
    block.state = ENDED
    return True


def prepare(work: Work) -> str:
    """How the calling thread is scheduled, in words."""
    task = work.task
    if task.stack_size is not None:
        touch_stack(max(task.stack_size - STACK_LEFT, 0) // 2)
    if work.place.participant is not None:
        return f"simulated: priority {task.priority or 0}, CPU {task.cpu or 0}"
    with contextlib.suppress(OSError):  # without it, wake-ups are up to 50 us less precise
        libc.change_timer_slack(1)
    return str(schedule(task, work.best_effort))


def schedule(task: Task, best_effort: bool) -> Scheduling:
    """Priority and processor of the calling thread."""
    refusals = []
    if task.cpu is not None:
        cpus = {task.cpu}
        refusals += refusal(f"CPU {task.cpu}", lambda: os.sched_setaffinity(0, cpus))
    policy = os.SCHED_OTHER if task.priority is None else os.SCHED_FIFO
    parameters = os.sched_param(task.priority or 0)
    refusals += refusal(
        f"SCHED_FIFO {task.priority}", lambda: os.sched_setscheduler(0, policy, parameters)
    )
    if refusals and not best_effort:
        raise RealtimeError(
            "; ".join(refusals),
            hint=f"run as root, or once: {SET_CAPABILITIES}; or an rtprio line in "
            "/etc/security/limits.d; or best_effort=True does without",
        )
    return replace(what_scheduling(), refusals=tuple(refusals))


def leave_priority() -> None:
    """A task's last job is done: what ending a process takes (100 ms) is not to keep others from
    their instants."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def iterate(work: Work, block: Block) -> None:
    timer = work.place.open_timer()
    timer.wait_until(block.origin_ns)  # on a virtual clock: takes its place among the others
    running = Running(work.task, block, timer)
    with counted_collections(running.releases):
        work.task.function(running, *work.task.arguments)
        running.finish()


@contextlib.contextmanager
def counted_collections(releases: Releases) -> Iterator[None]:
    gc.callbacks.append(releases.count_collection)
    try:
        yield
    finally:
        gc.callbacks.remove(releases.count_collection)


def reason(error: Exception) -> str:
    """What a person reads: our own errors as they are, others with the line that raised them."""
    if isinstance(error, CatenaryError):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{where}"

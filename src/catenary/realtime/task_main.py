"""Main function of a task, in its own thread or process."""

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
from catenary.realtime._stack import touch_stack
from catenary.realtime._task import ENDED, FAILED, STARTED, Block, Releases
from catenary.realtime.running_task import Running
from catenary.realtime.system import libc
from catenary.realtime.system.preparation import SET_CAPABILITIES, Session
from catenary.realtime.system.scheduling import Scheduling, current_scheduling, refusal
from catenary.realtime.task import Task
from catenary.realtime.task_memory import Place

START_SECONDS = 60.0  # longest time from the start of one task to the start of all
STACK_LEFT = 32 * 1024  # [bytes] not pre-faulted, because it is already in use


@dataclass(frozen=True, slots=True)
class Work:
    """Arguments of a worker."""

    task: Task
    place: Place
    best_effort: bool


def run_in_process(work: Work, session: Session | None, parent: int) -> None:
    """Run a task in its process, and exit with 0.

    If the task fails, store the reason in its block and exit with 1.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C and stops its tasks
    signal.signal(signal.SIGTERM, end_now)
    libc.signal_on_parents_death(signal.SIGTERM)
    if os.getppid() != parent:
        sys.exit("the parent process has ended")
    if work.task.stack_size is not None:
        _, hard_limit = resource.getrlimit(resource.RLIMIT_STACK)
        resource.setrlimit(resource.RLIMIT_STACK, (work.task.stack_size, hard_limit))
    with session or contextlib.nullcontext():
        failed = not run(work)
    sys.exit(1 if failed else 0)


def end_now(number: int, frame: object) -> None:
    """Exit on SIGTERM, so that `finally` blocks run.

    SIGTERM is sent when the parent ends or `Tasks.stop` times out.
    """
    sys.exit(128 + number)


def start_thread(work: Work, ended: Callable[[str], None]) -> threading.Thread:
    """Start the task in its own thread. The thread calls `ended` as its last action."""

    def body() -> None:
        run(work)
        ended(work.task.name)

    thread = threading.Thread(target=body, name=work.task.name, daemon=True)
    with stack_size(work.task.stack_size):
        thread.start()
    return thread


@contextlib.contextmanager
def stack_size(size: int | None) -> Iterator[None]:
    """Set the stack size of new threads during the block. Python's setting is global."""
    if size is None:
        yield
        return
    before = threading.stack_size(size)
    try:
        yield
    finally:
        threading.stack_size(before)


def run(work: Work) -> bool:
    """Run a task. If it fails, store the reason in its block and return False."""
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
    """Prepare the calling thread, and return a description of its scheduling."""
    task = work.task
    if task.stack_size is not None:
        touch_stack(max(task.stack_size - STACK_LEFT, 0) // 2)
    if work.place.participant is not None:
        return f"simulated: priority {task.priority or 0}, CPU {task.cpu or 0}"
    with contextlib.suppress(OSError):  # without it, wake-ups are up to 50 us less precise
        libc.change_timer_slack(1)
    return str(schedule(task, work.best_effort))


def schedule(task: Task, best_effort: bool) -> Scheduling:
    """Set priority and processor of this thread. Return the result, with the refusals.

    Raises:
        RealtimeError: The kernel refuses one of them, and `best_effort` is False.
    """
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
            hint=f"run as root, or run once: {SET_CAPABILITIES}; or add an rtprio line to "
            "/etc/security/limits.d; or set best_effort=True to continue without it",
        )
    return replace(current_scheduling(), refusals=tuple(refusals))


def leave_priority() -> None:
    """Return to ordinary scheduling after the last job.

    Ending a process takes about 100 ms, which must not delay the releases of other tasks.
    """
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def iterate(work: Work, block: Block) -> None:
    timer = work.place.open_timer()
    timer.wait_until(block.origin_ns)  # on a virtual clock, this is the participant's first wait
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
    """Return the text of an error, with its source line unless it is a CatenaryError."""
    if isinstance(error, CatenaryError):
        return str(error)
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
    return f"{type(error).__name__}: {error}{where}"

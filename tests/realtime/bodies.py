"""Functions of tasks; processes import them by name."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

from catenary.realtime import Queue, Running, Signal, Value


def idle(task: Running) -> None:
    for _job in task:
        pass


def spend(task: Running, seconds: float) -> None:
    for _job in task:
        task.spend(seconds)


def note(task: Running, notes: Queue) -> None:
    """Put the number, the release time and the current time [ns] of every job."""
    for job in task:
        notes.put([job.number, job.release_ns, task.now_ns])


def spend_and_note(task: Running, seconds: float, notes: Queue) -> None:
    """Spend time in every job, and put its end time."""
    for job in task:
        task.spend(seconds)
        notes.put([job.number, job.release_ns, task.now_ns])


def count_to(task: Running, last: int) -> None:
    for job in task:
        if job.number == last:
            return


def fail_at(task: Running, number: int) -> None:
    for job in task:
        if job.number == number:
            raise ArithmeticError("the sum is not right")


def fail_always(task: Running) -> None:
    for _job in task:
        raise ArithmeticError("the sum is not right")


def hang_at(task: Running, number: int, there: Value) -> None:
    """Hang in one job until the process is killed. The restarted task continues normally."""
    for job in task:
        if job.number == number and there.number == 0:
            there.write(os.getpid())
            signal.pause()


def ignore_the_end(task: Running, there: Value) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    there.write(1)
    while True:
        time.sleep(60.0)


def leave_a_trace(task: Running, path: str, there: Value) -> None:
    """Run without waiting, and write a file in a `finally` block."""
    try:
        there.write(os.getpid())
        while True:
            time.sleep(60.0)
    finally:
        Path(path).write_text("cleaned up")


def double_the_period(task: Running, notes: Queue) -> None:
    for job in task:
        notes.put([job.number, job.release_ns, task.now_ns])
        if job.number == 1:
            task.period *= 2


def set_at_every_job(task: Running, alarm: Signal, times: int) -> None:
    for _job in task:
        for _ in range(times):
            alarm.set()


def set_then_spend(task: Running, alarm: Signal, seconds: float) -> None:
    for _job in task:
        task.spend(seconds / 2)
        alarm.set()
        task.spend(seconds / 2)


def write_forever(task: Running, value: Value) -> None:
    """Write arrays whose elements are all equal."""
    import numpy as np

    for _job in task:
        while True:
            value.write(np.full(512, value.number + 1.0))


def put_forever(task: Running, queue: Queue) -> None:
    import numpy as np

    number = 0.0
    for _job in task:
        while True:
            number += 1.0
            queue.put(np.full(64, number))


def overrun_once(task: Running, at: int, seconds: float, notes: Queue) -> None:
    for job in task:
        notes.put([job.number, job.release_ns, task.now_ns])
        if job.number == at:
            task.spend(seconds)


def stack_deep(task: Running, found: Value) -> None:
    import resource
    import threading

    for _job in task:
        found.write([threading.stack_size(), resource.getrlimit(resource.RLIMIT_STACK)[0]])
        return


def report_scheduling(task: Running, found: Value) -> None:
    for _job in task:
        priority = os.sched_getparam(0).sched_priority
        cpu = min(os.sched_getaffinity(0))
        found.write([os.sched_getscheduler(0), priority, os.getpid(), cpu])
        return


def wait_for_event(task: Running, event: threading.Event) -> None:
    event.wait(30.0)

"""Main function of a task."""

from __future__ import annotations

import os
import time

import pytest

from catenary.realtime import Task, Value
from catenary.realtime.handle import Handle
from catenary.realtime.task_main import Work, start_thread
from tests.realtime import bodies


def test_ordinary_scheduling_after_the_last_job():
    """The end of a process takes 100 ms, which would delay tasks of lower priority."""
    found = Value("i8", 4)
    task = Task(bodies.report_scheduling, (found,), period=1e-3, priority=7)
    handle = Handle(task, None)
    handle.block.start_at(time.monotonic_ns())
    afterwards: list[int] = []
    work = Work(task, handle.place, best_effort=True)
    thread = start_thread(work, lambda _name: afterwards.append(os.sched_getscheduler(0)))
    thread.join(30.0)
    if int(found.read()[0]) != os.SCHED_FIFO:
        pytest.skip("needs real-time scheduling")
    assert afterwards == [os.SCHED_OTHER]

"""Scheduling of threads that work while a cycle runs."""

from __future__ import annotations

import contextlib
import os

BEHIND = 1  # lowest SCHED_FIFO priority


def step_behind() -> None:
    """Run the calling thread at the lowest SCHED_FIFO priority, if it inherited a real-time one.

    A thread inherits the scheduling of its creator. In a real-time program this is the priority of
    the loop, and the thread would delay cycle starts. The thread stays a real-time thread, because
    ordinary programs must not preempt it while it holds the GIL, which an inline loop needs.
    """
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    if policy in (os.SCHED_FIFO, os.SCHED_RR):
        with contextlib.suppress(OSError):  # forbidden by a filter: the scheduling is unchanged
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(BEHIND))


def leave_real_time() -> None:
    """Run the calling thread under SCHED_OTHER: its work is never urgent for the cycle."""
    with contextlib.suppress(OSError):  # forbidden by a filter: the scheduling is unchanged
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))

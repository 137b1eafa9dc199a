"""The scheduling of threads that work beside the cycle."""

from __future__ import annotations

import contextlib
import os

BEHIND = 1  # SCHED_FIFO: the last of all real-time threads


def step_behind() -> None:
    """A thread inherits the scheduling of who starts it: in a real-time program the calling one has
    the priority of the loop, and would keep it from its instants. It goes behind all real-time
    threads, but stays one: no ordinary program is to stop it while it has the interpreter, which
    an inline loop needs."""
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    if policy in (os.SCHED_FIFO, os.SCHED_RR):
        with contextlib.suppress(OSError):  # a filter forbids it: then all is as it was
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(BEHIND))

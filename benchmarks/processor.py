"""Processor time of other processes, as the kernel counts it."""

from __future__ import annotations

import time

CPUCLOCK_SCHED = 2  # linux/posix-timers.h


def processor_clock(pid: int) -> int:
    """For `time.clock_gettime`: of all threads of a process (clock_getcpuclockid(3), Linux)."""
    return ~pid << 3 | CPUCLOCK_SCHED


def processor_time(pid: int) -> float:
    """[s] so far. OSError: there is no such process."""
    return time.clock_gettime(processor_clock(pid))

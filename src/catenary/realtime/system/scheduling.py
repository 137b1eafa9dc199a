"""Real-time scheduling of the calling thread: request it, and read the resulting settings."""

from __future__ import annotations

import ctypes
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

MCL_CURRENT, MCL_FUTURE = 1, 2  # bits/mman-linux.h
POLICIES = {
    os.SCHED_OTHER: "SCHED_OTHER",
    os.SCHED_FIFO: "SCHED_FIFO",
    os.SCHED_RR: "SCHED_RR",
    os.SCHED_BATCH: "SCHED_BATCH",
    os.SCHED_IDLE: "SCHED_IDLE",
}


@dataclass(frozen=True, slots=True)
class Scheduling:
    """Scheduling of a thread. `refusals` lists the refused requests and the reasons."""

    policy: str
    priority: int
    memory_locked: bool
    cpus: tuple[int, ...]
    refusals: tuple[str, ...] = ()

    @property
    def real_time(self) -> bool:
        """True if the policy is SCHED_FIFO or SCHED_RR."""
        return self.policy in ("SCHED_FIFO", "SCHED_RR")

    def __str__(self) -> str:
        policy = f"{self.policy} {self.priority}" if self.real_time else self.policy
        memory = "memory locked" if self.memory_locked else "memory not locked"
        cpus = f"CPU{'s' if len(self.cpus) > 1 else ''} {','.join(map(str, self.cpus))}"
        return ", ".join((policy, memory, cpus, *self.refusals))


def current_scheduling() -> Scheduling:
    """Return the current scheduling of the calling thread."""
    policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
    return Scheduling(
        policy=POLICIES.get(policy, f"policy {policy}"),
        priority=os.sched_getparam(0).sched_priority,
        memory_locked=locked_kilobytes() > 0,
        cpus=tuple(sorted(os.sched_getaffinity(0))),
    )


def request_scheduling(
    *, priority: int = 80, lock_memory: bool = True, cpu: int | None = None
) -> Scheduling:
    """Request SCHED_FIFO, locked memory and one CPU for the calling thread.

    Threads that the calling thread starts afterwards inherit these settings.

    Args:
        priority: SCHED_FIFO priority, 1..99.
        lock_memory: lock all pages of the process in memory.
        cpu: CPU to bind the thread to; None keeps its current affinity.

    Returns:
        The resulting scheduling. Its `refusals` lists the requests that the kernel refused; they
        do not raise an exception.

    Raises:
        ValueError: `priority` is out of range.
    """
    if not 1 <= priority <= 99:
        raise ValueError(f"priority {priority} is not within 1..99")
    refusals = []
    if cpu is not None:
        refusals += refusal(f"CPU {cpu}", lambda: os.sched_setaffinity(0, {cpu}))
    if lock_memory:
        refusals += refusal("mlockall", lock_all_memory)
    parameters = os.sched_param(priority)
    refusals += refusal(
        f"SCHED_FIFO {priority}", lambda: os.sched_setscheduler(0, os.SCHED_FIFO, parameters)
    )
    now = current_scheduling()
    return Scheduling(now.policy, now.priority, now.memory_locked, now.cpus, tuple(refusals))


def refusal(what: str, request: Callable[[], object]) -> list[str]:
    try:
        request()
    except OSError as error:
        return [f"{what} refused ({error.strerror})"]
    return []


def lock_all_memory() -> None:
    """Lock every present and future page in memory (mlockall). Raises OSError if refused."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))


def locked_kilobytes() -> int:
    """Return the locked memory of this process [KiB], VmLck in proc(5)."""
    found = re.search(r"^VmLck:\s*(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
    return int(found[1]) if found else 0

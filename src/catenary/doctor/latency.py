"""Wake-up latency of this machine, measured with absolute times as cyclictest does.

The thread is a `realtime.Task` in a `realtime.session()`, as in a user's program: SCHED_FIFO,
locked memory, no deep sleep. `scheduling` has the policy and the refused settings.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

from catenary.doctor.check import Check, failed, passed, skipped, warned
from catenary.doctor.machine import Machine
from catenary.realtime import Task, Tasks, session
from catenary.realtime.running_task import Running
from catenary.realtime.statistics import Figure
from catenary.realtime.tasks import may_have

GOOD_SHARE, BAD_SHARE = 0.1, 0.5  # of the period


@dataclass(frozen=True, slots=True)
class Latency:
    """Latency of all wake-ups: time from the planned wake-up until the thread runs in Python.

    Times in [s]. histogram: (lower edge, upper edge, wake-ups) of all non-empty buckets.
    """

    seconds: float
    period: float
    cpu: int | None
    lateness: Figure
    missed: int  # wake-ups that were late by a whole period or more
    scheduling: str
    histogram: tuple[tuple[float, float, int], ...]


def wake_up(task: Running) -> None:
    for _ in task:
        pass


def measure(seconds: float, *, period: float, priority: int, cpu: int | None) -> Latency:
    """Wake a thread periodically, and measure its latency.

    Args:
        seconds: duration [s].
        period: period of the wake-ups [s].
        priority: SCHED_FIFO priority of the thread.
        cpu: processor of the thread; None for any.

    Raises:
        ValueError: the CPU does not exist.
    """
    task = Task(wake_up, period=period, priority=priority, cpu=cpu, name="latency")
    with (
        session(best_effort=True) as prepared,
        Tasks(task, workers="threads", best_effort=True) as tasks,
    ):
        tasks.join(seconds)
    statistics = tasks["latency"].statistics
    buckets = tasks["latency"].histogram("jitter")
    return Latency(
        seconds,
        period,
        cpu,
        statistics.jitter,
        statistics.misses,
        ", ".join((statistics.scheduling, *prepared.refusals)),
        tuple(buckets),
    )


def obtainable_cpu(machine: Machine) -> int | None:
    """Return the loop's CPU; None if this process may not use it."""
    cpu, allowed = machine.loop_cpu, os.sched_getaffinity(0)
    return cpu if cpu in allowed or may_have(cpu, allowed) else None


def judge(latency: Latency | None, machine: Machine) -> Check:
    """Compare the worst latency with the period of the loop."""
    id = "latency"
    if latency is None or latency.lateness.count == 0:
        return skipped(id, "not measured", "catenary doctor --seconds 3")
    figure, period = latency.lateness, latency.period
    found = (
        f"{figure.count} wake-ups with a period of {period * 1e6:g} us: median "
        f"{figure.p50 * 1e6:.1f}, p99.9 {figure.p999 * 1e6:.1f}, worst {figure.max * 1e6:.1f} us "
        f"late ({latency.scheduling})"
    )
    if figure.max <= GOOD_SHARE * period:
        return passed(id, found)
    advice = (
        "fix the failed checks above, then measure longer and under load: "
        "`catenary doctor --seconds 600` while `stress-ng --cpu 0 --vm 2 --hdd 1` runs"
    )
    if "SCHED_FIFO" not in latency.scheduling or "refused" in latency.scheduling:
        advice = "fix the permissions first (limit-rtprio, limit-memlock), then measure again"
    elif machine.virtual:
        advice = "the host can delay a virtual machine at any time; measure on real hardware"
    return (warned if figure.max <= BAD_SHARE * period else failed)(id, found, advice)

"""`python -m benchmarks tasks`: effect of a busy low-priority task on a high-priority task.

The tasks run in separate processes, then as threads that share the GIL.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from catenary.bench.loop import show_progress, write
from catenary.bench.report import machine
from catenary.bench.segment import processors
from catenary.figures import heading
from catenary.realtime import Running, Statistics, Task, Tasks, session

ROUND_SECONDS = 1.0
HIGH_PERIOD, LOW_PERIOD, LOW_BUSY = 1e-3, 10e-3, 8e-3  # [s]
HIGH_PRIORITY, LOW_PRIORITY = 80, 10
WAYS = ("alone", "processes", "threads", "threads-5ms")
SWITCH_INTERVALS = {"threads-5ms": 5e-3}  # [s] Python's default; otherwise that of a session
FIGURES = {"max": 1.0, "p50": 0.5, "p99": 0.99, "p999": 0.999}
AIM = 1.2  # limit of processes / alone, medians


@dataclass(slots=True)
class Found:
    """Owns the response times of the high-priority task over all rounds of one variant."""

    responses: Counter[float]  # [s]
    jobs: int = 0
    missed: int = 0
    scheduling: str = ""

    def percentile(self, fraction: float) -> float:
        """Return a percentile of the response times [us]."""
        rank, below = fraction * (self.responses.total() - 1), 0
        for seconds in sorted(self.responses):
            below += self.responses[seconds]
            if below > rank:
                return round(seconds * 1e6, 2)
        return math.nan


def compute_little(task: Running) -> None:
    for _job in task:
        sum(range(100))


def compute_much(task: Running) -> None:
    for _job in task:
        end = time.thread_time() + LOW_BUSY
        while time.thread_time() < end:
            sum(range(100))


def measure(*, seconds: float, file: Path | None) -> None:
    found = {way: Found(Counter()) for way in WAYS}
    rounds = math.ceil(seconds / ROUND_SECONDS)
    for number in range(rounds):
        for way in WAYS:
            show_progress(way, number + 1, rounds)
            run_round(way, found[way])
    ratio = found["processes"].percentile(0.5) / found["alone"].percentile(0.5)
    print(as_text(found, ratio))
    write(file, as_json(found, ratio))


def run_round(way: str, found: Found) -> None:
    cpu = processors().masters
    high = Task(compute_little, name="high", period=HIGH_PERIOD, priority=HIGH_PRIORITY, cpu=cpu)
    low = Task(compute_much, name="low", period=LOW_PERIOD, priority=LOW_PRIORITY, cpu=cpu)
    tasks = Tasks(
        *([high] if way == "alone" else [high, low]),
        workers="threads" if way.startswith("threads") else "processes",
        session=session(best_effort=True, switch_interval=SWITCH_INTERVALS.get(way, 1e-4)),
        best_effort=True,
    )
    with tasks:
        tasks.join(ROUND_SECONDS)
    statistics: Statistics = tasks["high"].statistics
    found.jobs += statistics.jobs
    found.missed += statistics.misses
    found.scheduling = statistics.scheduling
    for low_edge, above, count in tasks["high"].histogram("response"):
        found.responses[(low_edge + above) / 2] += count


def as_text(found: Mapping[str, Found], ratio: float) -> str:
    lines = [f"{machine()}\nresponse of a 1 kHz task next to a busy low-priority task [us]"]
    lines.append(
        f"{'':12}{'jobs':>8}{'missed':>8}" + "".join(f"{heading(name):>12}" for name in FIGURES)
    )
    for way, one in found.items():
        figures = (one.percentile(fraction) for fraction in FIGURES.values())
        lines.append(
            f"{way:12}{one.jobs:8d}{one.missed:8d}" + "".join(f"{us:12.2f}" for us in figures)
        )
    lines.append(f"processes / alone, medians: {ratio:.2f} (limit: {AIM})")
    return "\n".join(lines)


def as_json(found: Mapping[str, Found], ratio: float) -> dict[str, object]:
    return {
        "machine": machine(),
        "high": {"period": HIGH_PERIOD, "priority": HIGH_PRIORITY},
        "low": {"period": LOW_PERIOD, "busy": LOW_BUSY, "priority": LOW_PRIORITY},
        "ways": {
            way: {
                "jobs": one.jobs,
                "missed": one.missed,
                "scheduling": one.scheduling,
                "response_us": {
                    name: one.percentile(fraction) for name, fraction in FIGURES.items()
                },
            }
            for way, one in found.items()
        },
        "ratio": round(ratio, 3),
        "aim": AIM,
    }

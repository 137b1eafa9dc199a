"""`catenary bench latency`: wake-up latency of a thread, with the verdict of `catenary doctor`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.doctor.check import Check
from catenary.doctor.examination import this_machine
from catenary.doctor.latency import judge, obtainable_cpu
from catenary.doctor.latency import measure as measure_wake_ups
from catenary.doctor.report import check_lines, latency_us
from catenary.figures import FIGURES, heading

WIDTH = 100


def measure(
    *, seconds: float, period: float, priority: int, cpu: int | None, file: Path | None
) -> bool:
    """Measure the wake-up latency of a thread, print it, and write it to `file` as JSON.

    Args:
        seconds: Duration of the measurement [s].
        period: Period of the wake-ups [s].
        priority: SCHED_FIFO priority of the thread.
        cpu: CPU of the thread; None for the one that `catenary doctor` selects for a loop.
        file: File for the figures; None to write no file.

    Returns:
        True unless the verdict is FAIL.

    Raises:
        ValueError: The CPU does not exist.
    """
    here = this_machine(None, cpu=cpu, period=period, priority=priority)
    cpu = obtainable_cpu(here) if cpu is None else cpu
    latency = measure_wake_ups(seconds, period=period, priority=priority, cpu=cpu)
    check = judge(latency, here)
    figures: dict[str, object] = {
        "machine": machine(),
        "latency_us": latency_us(latency),
        "verdict": {"status": check.status, "found": check.found, "advice": check.advice},
    }
    print(as_text(figures))
    write(file, figures)
    return check.status != "FAIL"


def as_text(figures: Mapping[str, Any]) -> str:
    """Return the figures of a result and its verdict as text."""
    lateness = figures["latency_us"]
    check = Check("latency", **figures["verdict"])
    return "\n".join(
        [
            f"{figures['machine']}\n",
            "".join(f"{heading(name):>10}" for name in FIGURES) + "  late [us]",
            "".join(f"{lateness[name]:10.1f}" for name in FIGURES) + "\n",
            *check_lines(check, False, WIDTH),
        ]
    )

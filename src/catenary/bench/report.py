"""The benchmark's figures for people and for programs."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path

from catenary.bench.statistics import Run

COLUMNS = ("period", "lateness", "receive", "process", "send", "in_controller", "tail")
FIGURES = ("p50", "p99", "p999", "max")


def machine() -> str:
    """Processor, how many, kernel, interpreter: what the figures hold for."""
    return (
        f"{processor()}, {os.cpu_count()} CPUs, {platform.system()} {platform.release()} "
        f"{preemption()}, {platform.python_implementation()} {platform.python_version()}"
    )


def processor() -> str:
    for line in _lines(Path("/proc/cpuinfo")):
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def preemption() -> str:
    words = [word for word in platform.version().split() if "PREEMPT" in word]
    return words[0] if words else "no PREEMPT"


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines()
    except OSError:
        return []


def as_json(
    runs: Sequence[Run], ratios: Mapping[str, float], setting: Mapping[str, object]
) -> dict[str, object]:
    return {
        "machine": machine(),
        **setting,
        "runs": [
            {
                "name": run.name,
                "cycles": run.cycles,
                "lost": run.lost,
                "late": run.late,
                "cpu_us_per_cycle": round(run.cpu_us_per_cycle, 3),
                **({"answers": run.answers} if run.answers else {}),
                "scheduling": run.scheduling,
                "timing_us": run.timing_us,
            }
            for run in runs
        ],
        "ratios": dict(ratios),
    }


def as_text(runs: Sequence[Run], ratios: Mapping[str, float]) -> str:
    """Medians side by side, then the tails, then the ratios."""
    blocks = [_table(runs, figure) for figure in FIGURES]
    totals = [f"{'':18}{'cycles':>9}{'lost':>7}{'late':>7}{'CPU [us/cycle]':>16}"]
    totals += [
        f"{run.name:18}{run.cycles:9d}{run.lost:7d}{run.late:7d}{run.cpu_us_per_cycle:16.1f}"
        for run in runs
    ]
    quotients = [f"  {name:54}{value:7.2f}" for name, value in ratios.items()]
    blocks += ["\n".join(totals)]
    if quotients:
        blocks += ["ratios of the medians\n" + "\n".join(quotients)]
    return "\n\n".join(blocks)


def _table(runs: Sequence[Run], figure: str) -> str:
    title = {"p50": "median [us]", "p999": "p99.9 [us]"}.get(figure, f"{figure} [us]")
    lines = [f"{title:18}" + "".join(f"{name:>15}" for name in COLUMNS)]
    lines += [
        f"{run.name:18}" + "".join(f"{run.timing_us[name][figure]:15.2f}" for name in COLUMNS)
        for run in runs
    ]
    return "\n".join(lines)

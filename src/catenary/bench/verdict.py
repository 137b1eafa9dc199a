"""Verdicts on the output delay and the lost cycles of a loop."""

from __future__ import annotations

from collections.abc import Sequence

from catenary.bench.statistics import Run
from catenary.doctor.check import Status
from catenary.doctor.latency import BAD_SHARE, GOOD_SHARE

NAME = 20  # width of a name


def as_text(runs: Sequence[Run], rate: int) -> str:
    """Return the verdict on each run, with the figures that determine it."""
    period_us = 1e6 / rate
    lines = [
        f"verdict (PASS: output delay at most {GOOD_SHARE:.0%} of the period, no cycle lost; "
        f"FAIL: output delay above {BAD_SHARE:.0%})"
    ]
    for run in runs:
        worst = run.timing_us["output_delay"]["max"]
        lines.append(
            f"{run.name:{NAME}}{status_of(run, period_us)}  worst output delay {worst:.1f} us, "
            f"{worst / period_us:.1%} of the period; {run.lost} of {run.cycles} cycles lost"
        )
    return "\n".join(lines)


def status_of(run: Run, period_us: float) -> Status:
    """Judge the worst output delay by the limits of `catenary doctor` for the worst wake-up."""
    worst = run.timing_us["output_delay"]["max"]
    if worst > BAD_SHARE * period_us:
        return "FAIL"
    return "PASS" if worst <= GOOD_SHARE * period_us and not run.lost else "WARN"

"""Times of tasks and of a loop, as a table.

Across machines, compare the shape of the tables, not the numbers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from catenary.figures import FIGURES as ALL_FIGURES
from catenary.realtime import Statistics

FIGURES = ALL_FIGURES[:4]  # mean, max, min, sd
Row: TypeAlias = tuple[float, float, float, float]


class TaskTimes(NamedTuple):
    """Mean, max, min and sd of the period [ms], the start jitter [us] and the response [us]."""

    period: Row
    jitter: Row
    response: Row


def of_task(statistics: Statistics) -> TaskTimes:
    """Return the times of a task of `realtime.Tasks`."""

    def row(name: str, scale: float) -> Row:
        figure = getattr(statistics, name)
        mean, high, low, sd = (getattr(figure, each) * scale for each in FIGURES)
        return mean, high, low, sd

    return TaskTimes(row("period", 1e3), row("jitter", 1e6), row("response", 1e6))


def of_loop(timing: Mapping[str, Mapping[str, float]]) -> TaskTimes:
    """Return the times of a loop, in the terms of a task.

    The lateness of a loop is the jitter of a task. The sum of lateness and in_controller is the
    response, which ends with the sent frame. The minima and maxima of the two may be from different
    cycles, so the response is a bound.
    """

    def row(scale: float, *phases: str) -> Row:
        mean, high, low, sd = (
            sum(timing[phase][each] for phase in phases) * scale for each in FIGURES
        )
        return mean, high, low, sd

    return TaskTimes(
        row(1e3, "period"), row(1e6, "lateness"), row(1e6, "lateness", "in_controller")
    )


def as_table(ours: Mapping[str, TaskTimes], published: Mapping[str, TaskTimes]) -> str:
    """Return a table with our line of each task, followed by the published one, if any."""
    columns = ("period [ms] mean/max/min/sd", "jitter [us]", "response [us]")
    lines = [f"{'task':14}" + "".join(f"{column:>31}" for column in columns)]
    for name, times in ours.items():
        lines.append(_line(name, times))
        if name in published:
            lines.append(_line("  published", published[name]))
    return "\n".join(lines)


def _line(name: str, times: TaskTimes) -> str:
    texts = (
        "/".join(f"{value:.{digits}f}" for value in row)
        for row, digits in zip(times, (3, 1, 1), strict=True)
    )
    return f"{name:14}" + "".join(f"{text:>31}" for text in texts)

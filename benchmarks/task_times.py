"""What tasks and a loop among them came to, as a table. Other machines: compare shapes, not
numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from catenary.figures import FIGURES as ALL_FIGURES
from catenary.realtime import Statistics

FIGURES = ALL_FIGURES[:4]  # mean, max, min, sd
Row: TypeAlias = tuple[float, float, float, float]


class TaskTimes(NamedTuple):
    """Each mean, max, min, sd: period [ms], jitter of the start and response [us]."""

    period: Row
    jitter: Row
    response: Row


def of_task(statistics: Statistics) -> TaskTimes:
    """What a task of `realtime.Tasks` came to."""

    def row(name: str, scale: float) -> Row:
        figure = getattr(statistics, name)
        mean, high, low, sd = (getattr(figure, each) * scale for each in FIGURES)
        return mean, high, low, sd

    return TaskTimes(row("period", 1e3), row("jitter", 1e6), row("response", 1e6))


def of_loop(timing: Mapping[str, Mapping[str, float]]) -> TaskTimes:
    """What a loop came to: its lateness is a task's jitter; lateness and in_controller together
    its response, which the frame that was sent ends. (Minima and maxima of the two need not be of
    one cycle: the response is safe, not exact.)"""

    def row(scale: float, *phases: str) -> Row:
        mean, high, low, sd = (
            sum(timing[phase][each] for phase in phases) * scale for each in FIGURES
        )
        return mean, high, low, sd

    return TaskTimes(
        row(1e3, "period"), row(1e6, "lateness"), row(1e6, "lateness", "in_controller")
    )


def as_table(ours: Mapping[str, TaskTimes], published: Mapping[str, TaskTimes]) -> str:
    """Two lines a task. Of ours that are not published one."""
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

"""Published tables, and ours beside them. Other machines: compare shapes, not numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from catenary.realtime import Statistics

FIGURES = ("min", "max", "mean", "sd")
Row: TypeAlias = tuple[float, float, float, float]


class TaskTimes(NamedTuple):
    """Each min, max, mean, sd: period [ms], jitter of the start and response [us]."""

    period: Row
    jitter: Row
    response: Row


# Six tasks of a six-axis cobot under cyclic torque control, 5 minutes, PREEMPT_RT: PyIgH, section 2
# of the publication. "stop" is its sporadic error task, "monitor" its ROS 2 node.
COBOT: Mapping[str, TaskTimes] = {
    "dynamics": TaskTimes(
        (0.959, 1.041, 1.0, 0.007),
        (1.086, 48.328, 16.811, 4.346),
        (39.624, 165.733, 97.555, 17.978),
    ),
    "main control": TaskTimes(
        (0.975, 1.025, 1.0, 0.001),
        (1.028, 22.405, 1.686, 0.795),
        (133.508, 339.378, 225.162, 19.356),
    ),
    "trajectory": TaskTimes(
        (1.965, 2.035, 2.0, 0.002),
        (1.171, 32.46, 2.064, 1.216),
        (4.732, 455.232, 24.338, 46.769),
    ),
    "monitor": TaskTimes(
        (9.883, 10.116, 10.0, 0.026),
        (6.309, 198.234, 97.859, 19.451),
        (9.272, 836.576, 326.594, 82.731),
    ),
    "log": TaskTimes(
        (99.554, 100.502, 100.0, 0.082),
        (1.454, 504.362, 56.924, 60.639),
        (3.832, 513.557, 61.772, 61.281),
    ),
    "stop": TaskTimes(
        (999.292, 1000.642, 1000.0, 0.028426),
        (1.766, 352.268, 8.338, 28.426),
        (4.735, 358.615, 12.633, 28.872),
    ),
}
COBOT_UTILISATION = 0.737  # schedulable by rate-monotonic analysis


def of_task(statistics: Statistics) -> TaskTimes:
    """What a task of `realtime.Tasks` came to."""

    def row(name: str, scale: float) -> Row:
        figure = getattr(statistics, name)
        low, high, mean, sd = (getattr(figure, each) * scale for each in FIGURES)
        return low, high, mean, sd

    return TaskTimes(row("period", 1e3), row("jitter", 1e6), row("response", 1e6))


def of_loop(timing: Mapping[str, Mapping[str, float]]) -> TaskTimes:
    """What a loop came to: its lateness is a task's jitter; lateness and in_controller together
    its response, which the frame that was sent ends. (Minima and maxima of the two need not be of
    one cycle: the response is safe, not exact.)"""

    def row(scale: float, *phases: str) -> Row:
        low, high, mean, sd = (
            sum(timing[phase][each] for phase in phases) * scale for each in FIGURES
        )
        return low, high, mean, sd

    return TaskTimes(
        row(1e-3, "period"), row(1.0, "lateness"), row(1.0, "lateness", "in_controller")
    )


def as_table(ours: Mapping[str, TaskTimes], published: Mapping[str, TaskTimes]) -> str:
    """Two lines a task. Of ours that are not published one."""
    columns = ("period [ms] min/max/mean/sd", "jitter [us]", "response [us]")
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

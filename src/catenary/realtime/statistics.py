"""Statistics of the jobs of a task, read from its shared memory."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from catenary.realtime._task import FIGURE_NAMES, Block
from catenary.realtime.analysis import Demand
from catenary.realtime.task import Task

TIMES = ("period", "jitter", "response", "execution")  # in [s]; other figures are counts


@dataclass(frozen=True, slots=True)
class Figure:
    """Summary of one quantity over all jobs that have ended."""

    count: int
    mean: float
    min: float
    max: float
    sd: float
    p50: float
    p99: float
    p999: float


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of one task. While the task runs, figures may lack the newest job."""

    name: str
    jobs: int  # released
    misses: int  # ended after the deadline
    skipped: int  # releases skipped after a miss or a restart
    signals_refused: int
    scheduling: str  # settings of its thread, and refused requests
    period: Figure  # [s] from start to start
    jitter: Figure  # [s] from release to start
    response: Figure  # [s] from release to end
    execution: Figure  # [s] processor time of the thread; on a virtual clock, the time spent
    page_faults: Figure  # per job
    switches: Figure  # involuntary context switches per job
    collections: Figure  # runs of the garbage collector in its process per job


def read_statistics(name: str, block: Block) -> Statistics:
    jobs, misses, skipped, refused = block.counts
    figures = (read_figure(block, number) for number in range(len(FIGURE_NAMES)))
    return Statistics(name, jobs, misses, skipped, refused, block.scheduling, *figures)


def read_figure(block: Block, number: int) -> Figure:
    count, *values = block.figure(number)
    scale = 1e-9 if FIGURE_NAMES[number] in TIMES else 1.0
    return Figure(count, *(value * scale for value in values))


def read_histogram(block: Block, figure: str) -> list[tuple[float, float, int]]:
    """Return (lower edge, upper edge, jobs) of every non-empty bucket; times in [s].

    Raises ValueError if `figure` is not one of FIGURE_NAMES.
    """
    if figure not in FIGURE_NAMES:
        raise ValueError(f"unknown figure {figure!r}; use one of {', '.join(FIGURE_NAMES)}")
    scale = 1e-9 if figure in TIMES else 1
    buckets = block.buckets(FIGURE_NAMES.index(figure))
    return [(low * scale, above * scale, count) for low, above, count in buckets]


def measured_demand(task: Task, statistics: Statistics) -> Demand:
    """Return the demand of a task with its longest measured execution time.

    Raises ValueError if no job has ended yet.
    """
    if statistics.execution.count == 0:
        raise ValueError(f"{task}: no job has ended yet, so there is no execution time")
    return Demand(
        name=task.name,
        period=task.period,
        execution=statistics.execution.max,
        deadline=task.deadline,
        priority=task.priority or 0,
        cpu=task.cpu,
    )


def as_table(all_statistics: Iterable[Statistics]) -> str:
    """Return a table with one line per task. Times are mean, max, min and standard deviation."""
    lines = [
        f"{'task':14}{'jobs':>8}{'missed':>8}"
        + "".join(f"{name + ' [ms]: mean/max/min/sd':>36}" for name in ("period", "response"))
        + f"{'jitter max':>12}{'faults':>8}{'switches':>10}{'GC':>5}  scheduling"
    ]
    lines += [as_line(statistics) for statistics in all_statistics]
    return "\n".join(lines)


def as_line(s: Statistics) -> str:
    times = (
        "/".join(f"{value * 1e3:.3f}" for value in (f.mean, f.max, f.min, f.sd))
        for f in (s.period, s.response)
    )
    counts = (total(f) for f in (s.page_faults, s.switches, s.collections))
    return (
        f"{s.name:14}{s.jobs:8d}{s.misses:8d}"
        + "".join(f"{text:>36}" for text in times)
        + f"{s.jitter.max * 1e3:12.3f}"
        + "".join(f"{count:>{width}d}" for count, width in zip(counts, (8, 10, 5), strict=True))
        + f"  {s.scheduling}"
    )


def total(figure: Figure) -> int:
    return round(figure.mean * figure.count)

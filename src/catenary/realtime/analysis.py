"""Response-time analysis of tasks with fixed priorities that preempt one another.

Joseph and Pandya, "Finding response times in a real-time system", 1986, and its extension to
release jitter, blocking and arbitrary deadlines: Tindell, Burns and Wellings, "An extendible
approach for analysing fixed priority hard real-time tasks", 1994, equations 12 to 16:

    w(q) = (q + 1) C + B + sum over tasks j of higher or equal priority: ceil((w(q) + Jj) / Tj) Cj
    R    = max over q = 0, 1, ... of  J + w(q) - q T,  up to the first job that ends before the
           next release

Each task treats other tasks of equal priority as higher. SCHED_FIFO serves them in the order of
their releases, so this is an upper bound. All sums are integers, in nanoseconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

LONGEST = 1e9  # [s]
MOST_STEPS = 1_000_000  # iteration limit for one task; only loads close to 1 reach it


@dataclass(frozen=True, slots=True, kw_only=True)
class Demand:
    """Load of a task on its processor.

    Args:
        name: Name of the task.
        period: Minimum time between two releases [s].
        execution: Longest execution time of one job [s].
        deadline: Deadline after the release [s]; None for the period. It may exceed the period.
        blocking: Longest time for which a task of lower priority blocks the task [s].
        jitter: Longest delay of a release after its nominal time [s].
        priority: Priority; a larger number is higher. If all tasks have None, their priorities
            are deadline-monotonic.
        cpu: Processor of the task. If all tasks have None, they share one processor.

    Raises:
        ValueError: A time is negative, not finite or too long, or `period` or `deadline` is 0.
    """

    name: str
    period: float
    execution: float
    deadline: float | None = None
    blocking: float = 0.0
    jitter: float = 0.0
    priority: int | None = None
    cpu: int | None = None

    def __post_init__(self) -> None:
        for what in ("period", "deadline", "execution", "blocking", "jitter"):
            seconds = getattr(self, what)
            if seconds is not None:
                self._check(what, seconds, 1 if what in ("period", "deadline") else 0)

    def _check(self, what: str, seconds: float, least_ns: int) -> None:
        if not math.isfinite(seconds) or seconds > LONGEST:
            raise ValueError(
                f"task {self.name!r}: {what} of {seconds} s is beyond the maximum of {LONGEST:g} s"
                "; give it in seconds"
            )
        if round(seconds * 1e9) < least_ns:
            word = "not positive" if least_ns else "negative"
            raise ValueError(f"task {self.name!r}: {what} of {seconds} s is {word}")


@dataclass(frozen=True, slots=True)
class Response:
    """Longest response of one task. Times in [s]; `response` is None if there is no bound."""

    name: str
    priority: int
    period: float
    execution: float
    deadline: float
    response: float | None

    @property
    def in_time(self) -> bool:
        """True if the longest response is within the deadline."""
        return self.response is not None and self.response <= self.deadline


@dataclass(frozen=True, slots=True)
class Verdict:
    """Result of an analysis: utilisation of the busiest processor, hyperperiod [s], responses."""

    utilisation: float
    hyperperiod: float
    responses: tuple[Response, ...]  # highest priority first

    @property
    def schedulable(self) -> bool:
        """True if every task meets its deadline."""
        return all(response.in_time for response in self.responses)

    def __str__(self) -> str:
        lines = [f"{'task':16}{'priority':>9}" + "".join(f"{name:>14}" for name in COLUMNS)]
        lines += [as_line(response) for response in self.responses]
        word = "schedulable" if self.schedulable else "NOT schedulable"
        lines.append(
            f"{word}: utilisation {self.utilisation:.1%}, hyperperiod {self.hyperperiod * 1e3:g} ms"
        )
        return "\n".join(lines)


COLUMNS = ("period [ms]", "execution", "deadline", "response")


def as_line(response: Response) -> str:
    times = (response.period, response.execution, response.deadline)
    found = "unbounded" if response.response is None else f"{response.response * 1e3:.3f}"
    mark = "" if response.in_time else "  MISSED"
    return (
        f"{response.name:16}{response.priority:9d}"
        + "".join(f"{seconds * 1e3:14.3f}" for seconds in times)
        + f"{found:>14}{mark}"
    )


@dataclass(frozen=True, slots=True)
class Load:
    """A demand in whole nanoseconds."""

    period: int
    execution: int
    deadline: int
    blocking: int
    jitter: int


def analyse(demands: Sequence[Demand]) -> Verdict:
    """Analyse tasks that share one processor or are each bound to one of several.

    Raises:
        ValueError: There are no tasks, two tasks have the same name, or only some tasks have a
            priority or a processor.
    """
    check(demands)
    ranked = sorted(with_priorities(demands), key=lambda demand: -rank(demand))
    responses = []
    for demand in ranked:
        above = [
            as_load(other)
            for other in ranked
            if other is not demand and other.cpu == demand.cpu and rank(other) >= rank(demand)
        ]
        found = longest_response(as_load(demand), above)
        responses.append(
            Response(
                demand.name,
                rank(demand),
                demand.period,
                demand.execution,
                deadline_of(demand),
                None if found is None else found / 1e9,
            )
        )
    return Verdict(utilisation(demands), hyperperiod(demands), tuple(responses))


def check(demands: Sequence[Demand]) -> None:
    if not demands:
        raise ValueError("there are no tasks to analyse")
    names = [demand.name for demand in demands]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"two tasks have the name {name!r}")
    for what in ("priority", "cpu"):
        missing = [demand.name for demand in demands if getattr(demand, what) is None]
        if missing and len(missing) < len(demands):
            raise ValueError(
                f"task {missing[0]!r} has no {what}, but others do; set it for all or for none"
            )


def with_priorities(demands: Sequence[Demand]) -> list[Demand]:
    """Return the tasks with their priorities, or with deadline-monotonic ones if they have none.

    The deadline-monotonic assignment is optimal if no deadline is longer than its period.
    """
    if demands[0].priority is not None:
        return list(demands)
    deadlines = sorted({deadline_of(demand) for demand in demands}, reverse=True)
    return [
        replace(demand, priority=deadlines.index(deadline_of(demand)) + 1) for demand in demands
    ]


def rank(demand: Demand) -> int:
    assert demand.priority is not None  # ensured by with_priorities
    return demand.priority


def deadline_of(demand: Demand) -> float:
    return demand.period if demand.deadline is None else demand.deadline


def as_load(demand: Demand) -> Load:
    seconds = (
        demand.period,
        demand.execution,
        deadline_of(demand),
        demand.blocking,
        demand.jitter,
    )
    return Load(*(round(value * 1e9) for value in seconds))


def utilisation(demands: Sequence[Demand]) -> float:
    """Return the utilisation of the busiest processor; above 1.0, it is overloaded."""
    processors = {demand.cpu for demand in demands}
    return max(
        math.fsum(demand.execution / demand.period for demand in demands if demand.cpu == cpu)
        for cpu in processors
    )


def hyperperiod(demands: Sequence[Demand]) -> float:
    """Return the time [s] after which the releases repeat; infinity if a float cannot hold it."""
    try:
        return math.lcm(*(as_load(demand).period for demand in demands)) / 1e9
    except OverflowError:
        return math.inf


def longest_response(task: Load, above: Sequence[Load]) -> int | None:
    """Return the longest response [ns].

    Return None if the load exceeds 1, or if no bound is found within MOST_STEPS.
    """
    loads = (task, *above)
    if not bounded(loads):
        return None
    repeats = repeat_after(loads) if exactly_full(loads) else None
    longest, window, steps = 0, task.blocking + task.execution, 0
    for job in range(MOST_STEPS):
        window = max(window, task.blocking + (job + 1) * task.execution)
        while (needed := demand_within(window, job, task, above)) != window:
            window = needed
            steps += 1
            if steps > MOST_STEPS:
                return None
        longest = max(longest, task.jitter + window - job * task.period)
        if window + task.jitter <= (job + 1) * task.period:
            return longest
        if repeats is not None and (job + 1) * task.period >= repeats:
            return longest  # later responses repeat
        window += task.execution
    return None


def demand_within(window: int, job: int, task: Load, above: Sequence[Load]) -> int:
    """Return the execution time [ns] needed within `window` to finish job number `job`."""
    return (
        (job + 1) * task.execution
        + task.blocking
        + sum(-(-(window + other.jitter) // other.period) * other.execution for other in above)
    )


def bounded(loads: Sequence[Load]) -> bool:
    """Return True if the load is at most 1, computed exactly."""
    span = repeat_after(loads)
    return sum(span // load.period * load.execution for load in loads) <= span


def exactly_full(loads: Sequence[Load]) -> bool:
    span = repeat_after(loads)
    return sum(span // load.period * load.execution for load in loads) == span


def repeat_after(loads: Sequence[Load]) -> int:
    return math.lcm(*(load.period for load in loads))

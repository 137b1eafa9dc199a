"""Task: an immutable description of a function, its period, priority and policies."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from catenary.realtime.job import Job
    from catenary.realtime.trigger import Signal

OnMiss: TypeAlias = "Literal['count', 'skip', 'stop'] | Callable[[Job], object]"
OnFailure: TypeAlias = Literal["stop", "restart", "continue"]

SHORTEST_PERIOD = 20e-6  # [s] a wake-up alone takes several microseconds
LONGEST_PERIOD = 1e6
PRIORITIES = range(1, 100)  # SCHED_FIFO on Linux, sched(7)
SMALLEST_STACK = 32 * 1024  # minimum of threading.stack_size
PAGE = 4096


@dataclass(frozen=True, slots=True)
class Task:
    """A function that `Tasks` runs as `function(task, *arguments)`, with `for job in task:`.

    Args:
        function: Function of the task. Its first argument is the running task.
        arguments: Further arguments of the function.
        period: Time between two releases [s]. With a `trigger`, it is the minimum time.
        name: Name in reports and errors; by default, the name of the function.
        priority: SCHED_FIFO priority, 1 to 99; a larger number is higher. None for ordinary
            scheduling.
        cpu: Processor on which the task runs; None for any.
        stack_size: Size of the stack [bytes], a multiple of 4096, at least 32 KiB. None for the
            default size.
        deadline: Deadline after the release [s]; None for the period.
        trigger: Signal that releases a sporadic task; None for a periodic task.
        on_miss: Reaction to a missed deadline. "count": count the job and continue with the next
            release, late or not. "skip": skip the releases that have passed. "stop": stop the task
            with an error. A function: call it with the late job.
        on_failure: Reaction if the task raises or its process ends. "stop": stop all tasks with an
            error. "restart": restart the task at its next release; the fourth failure stops all
            tasks. "continue": continue without it.

    Raises:
        TypeError: `function` is not callable, `arguments` is not a tuple, or a time is not a
            number.
        ValueError: A time, the priority, processor, stack size or a reaction is invalid.
    """

    function: Callable[..., object]
    arguments: tuple[object, ...] = ()
    period: float = field(kw_only=True)
    name: str = field(default="", kw_only=True)
    priority: int | None = field(default=None, kw_only=True)
    cpu: int | None = field(default=None, kw_only=True)
    stack_size: int | None = field(default=None, kw_only=True)
    deadline: float | None = field(default=None, kw_only=True)
    trigger: Signal | None = field(default=None, kw_only=True)
    on_miss: OnMiss = field(default="count", kw_only=True)
    on_failure: OnFailure = field(default="stop", kw_only=True)

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise TypeError(f"the task's function {self.function!r} is not callable")
        if not isinstance(self.arguments, tuple):
            raise TypeError(f"arguments must be a tuple such as (x,), not {self.arguments!r}")
        if not self.name:
            name = getattr(self.function, "__name__", type(self.function).__name__)
            object.__setattr__(self, "name", name)
        check_period(self.name, "period", self.period)
        if self.deadline is not None:
            check_period(self.name, "deadline", self.deadline)
        check_place(self)
        check_policies(self)

    def __str__(self) -> str:
        return f"task {self.name!r}"


def check_period(task: str, what: str, seconds: float) -> int:
    """Convert a time to whole nanoseconds.

    Args:
        task: name of the task, for errors.
        what: name of the quantity, for errors.
        seconds: the time [s].

    Raises:
        TypeError: `seconds` is not a number.
        ValueError: `seconds` is not positive, less than 20 us or more than 1e6 s.
    """
    if isinstance(seconds, bool) or not isinstance(seconds, int | float):
        raise TypeError(f"task {task!r}: {what} must be a number of seconds, not {seconds!r}")
    if not math.isfinite(seconds) or seconds <= 0:
        raise ValueError(f"task {task!r}: a {what} of {seconds} s is not positive")
    if seconds < SHORTEST_PERIOD:
        raise ValueError(
            f"task {task!r}: a {what} of {seconds * 1e6:g} us is too short, because wake-ups "
            f"take microseconds; use at least {SHORTEST_PERIOD * 1e6:g} us"
        )
    if seconds > LONGEST_PERIOD:
        raise ValueError(
            f"task {task!r}: a {what} of {seconds:g} s is longer than {LONGEST_PERIOD:g} s; "
            "give it in seconds"
        )
    return round(seconds * 1e9)


def check_place(task: Task) -> None:
    """Check priority, processor and stack size. Raises ValueError if one is out of range."""
    if task.priority is not None and task.priority not in PRIORITIES:
        raise ValueError(
            f"{task}: priority {task.priority} is not within 1..99; use None for ordinary "
            "scheduling"
        )
    if task.cpu is not None and (not isinstance(task.cpu, int) or not 0 <= task.cpu < 1024):
        raise ValueError(f"{task}: CPU {task.cpu} does not exist")
    size = task.stack_size
    if size is not None and (size < SMALLEST_STACK or size % PAGE):
        raise ValueError(
            f"{task}: invalid stack size of {size} bytes; use a multiple of {PAGE}, at least "
            f"{SMALLEST_STACK}"
        )


def check_policies(task: Task) -> None:
    if task.on_miss not in ("count", "skip", "stop") and not callable(task.on_miss):
        raise ValueError(
            f'{task}: on_miss must be "count", "skip", "stop" or a function, not {task.on_miss!r}'
        )
    if task.on_failure not in ("stop", "restart", "continue"):
        raise ValueError(
            f'{task}: on_failure must be "stop", "restart" or "continue", not {task.on_failure!r}'
        )

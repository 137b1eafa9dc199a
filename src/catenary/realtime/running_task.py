"""Running: the object that a task's function receives as its first argument."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.errors import TaskError
from catenary.realtime._clock import Timer
from catenary.realtime._task import Block, Releases
from catenary.realtime.job import Job
from catenary.realtime.task import Task, check_period


class Running:
    """Interface of a running task for its own function: `for job in task:`."""

    def __init__(self, task: Task, block: Block, timer: Timer) -> None:
        self._task = task
        self._block = block
        self._timer = timer
        self._releases = Releases(block, timer)
        self._job = Job(self._releases, block.origin_ns)

    @property
    def name(self) -> str:
        """Name of the task."""
        return self._task.name

    @property
    def now_ns(self) -> int:
        """Time of the task's clock [ns]: CLOCK_MONOTONIC or virtual time."""
        return self._timer.now_ns

    @property
    def period(self) -> float:
        """Time between releases [s]. Set it to change the period from the present release on."""
        return self._block.period_ns * 1e-9

    @period.setter
    def period(self, seconds: float) -> None:
        self._block.period_ns = check_period(self.name, "period", seconds)

    def __iter__(self) -> Iterator[Job]:
        while self.wait():
            yield self._job

    def wait(self) -> bool:
        """End the current job as in `finish`, and wait for the next release.

        Return False on a stop request.
        """
        self.finish()
        return self._releases.wait()

    def finish(self) -> None:
        """End the current job, if any, and apply `on_miss` if it missed its deadline.

        Raises TaskError for a miss with `on_miss="stop"`.
        """
        if not self._releases.finish():
            return
        if callable(self._task.on_miss):
            self._task.on_miss(self._job)
        elif self._task.on_miss == "stop":
            raise TaskError(
                f"a job ended after its deadline of {self._block.deadline_ns * 1e-6:.3f} ms",
                task=self.name,
                hint="the task's statistics show its response times; "
                'on_miss="count" continues after a miss',
            )

    def spend(self, seconds: float) -> None:
        """Spend execution time [s].

        On a virtual clock, time passes, and tasks of higher priority preempt this one. On the
        machine's clock, the thread uses this much processor time without the GIL.
        """
        self._releases.spend(round(seconds * 1e9))

    def stop(self) -> None:
        """Request a stop: the task ends when it next waits."""
        self._block.stop()

    @property
    def releases(self) -> Releases:
        """Compiled object that waits for the releases."""
        return self._releases

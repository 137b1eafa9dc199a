"""A task seen by its own function: `for job in task:`."""

from __future__ import annotations

from collections.abc import Iterator

from catenary.errors import TaskError
from catenary.realtime._clock import Timer
from catenary.realtime._task import Block, Releases
from catenary.realtime.job import Job
from catenary.realtime.task import Task, check_period


class Running:
    """Owns the releases of the task that its function runs in."""

    def __init__(self, task: Task, block: Block, timer: Timer) -> None:
        self._task = task
        self._block = block
        self._timer = timer
        self._releases = Releases(block, timer)
        self._job = Job(self._releases, block.origin_ns)

    @property
    def name(self) -> str:
        return self._task.name

    @property
    def now_ns(self) -> int:
        """The task's clock: CLOCK_MONOTONIC, or virtual time."""
        return self._timer.now_ns

    @property
    def period(self) -> float:
        """[s]. Set it to change the time from this release to the next ones."""
        return self._block.period_ns * 1e-9

    @period.setter
    def period(self, seconds: float) -> None:
        self._block.period_ns = check_period(self.name, "period", seconds)

    def __iter__(self) -> Iterator[Job]:
        while self.wait():
            yield self._job

    def wait(self) -> bool:
        """Ends the job that runs and waits for the next release. False: the task is to end."""
        self.finish()
        return self._releases.wait()

    def finish(self) -> None:
        """Ends the job that runs, and does what `on_miss` says."""
        if not self._releases.finish():
            return
        if callable(self._task.on_miss):
            self._task.on_miss(self._job)
        elif self._task.on_miss == "stop":
            raise TaskError(
                f"it ended after its deadline of {self._block.deadline_ns * 1e-6:.3f} ms",
                task=self.name,
                hint='its statistics say how long jobs take; on_miss="count" goes on',
            )

    def spend(self, seconds: float) -> None:
        """Spends this much execution time [s]. On a virtual clock it is declared: time passes, and
        tasks of higher priority preempt it. On the machine's the thread computes that long, without
        the interpreter's lock."""
        self._releases.spend(round(seconds * 1e9))

    def stop(self) -> None:
        """The task ends when it next waits."""
        self._block.stop()

    @property
    def releases(self) -> Releases:
        """The compiled side."""
        return self._releases

"""Handle: control of one running task from the process that started it."""

from __future__ import annotations

import signal

from catenary.errors import TaskError
from catenary.realtime._task import BLOCK_SIZE, ENDED, FAILED, NEW, Block
from catenary.realtime.clock import VirtualClock
from catenary.realtime.statistics import Statistics, read_histogram, read_statistics
from catenary.realtime.system.memory import SharedMemory
from catenary.realtime.task import Task, check_period
from catenary.realtime.task_memory import Place


class Handle:
    """Owner of the memory of one task."""

    def __init__(self, task: Task, clock: VirtualClock | None) -> None:
        participant = None
        if clock is not None:
            participant = clock.participate(priority=task.priority or 0, cpu=task.cpu or 0)
        self.task = task
        self.place = Place(SharedMemory(BLOCK_SIZE), participant)
        self.block = Block(self.place.memory.buffer)
        self.block.prepare(
            check_period(task.name, "period", task.period),
            0 if task.deadline is None else round(task.deadline * 1e9),
            task.trigger is not None,
            task.on_miss == "skip",
        )
        self._timer = self.place.open_timer()

    @property
    def name(self) -> str:
        """Name of the task."""
        return self.task.name

    @property
    def running(self) -> bool:
        """True until the task ends or fails."""
        return self.block.state not in (ENDED, FAILED)

    @property
    def process(self) -> int:
        """Process id of the task; 0 before it starts."""
        return self.block.process

    @property
    def period(self) -> float:
        """Time between releases [s]. Set it to change the period while the task runs."""
        return self.block.period_ns * 1e-9

    @period.setter
    def period(self, seconds: float) -> None:
        self.block.period_ns = check_period(self.name, "period", seconds)
        self._timer.wake()

    @property
    def statistics(self) -> Statistics:
        """Statistics of all jobs so far."""
        return read_statistics(self.name, self.block)

    def histogram(self, figure: str) -> list[tuple[float, float, int]]:
        """Return (lower edge, upper edge, jobs) of every bucket of a figure; times in [s]."""
        return read_histogram(self.block, figure)

    def stop(self) -> None:
        """Request a stop: the task ends when it next waits."""
        self.block.stop()
        self._timer.wake()

    def make_ready_again(self) -> None:
        """Reset the block for a restart, and skip all releases that have passed.

        Virtual time stands still until the restarted task first waits.
        """
        self.block.restart()
        self.block.skip_to(self._timer.now_ns)
        if self.place.participant is not None:
            self.place.participant.expect()

    def leave(self) -> None:
        """Leave the clock, because the worker has ended or was never started.

        Mark the task as failed if it has not ended.
        """
        if self.place.participant is not None:
            self.place.participant.leave()
        if self.running:
            self.block.state = FAILED

    def failure(self, exit_code: int | None) -> TaskError | None:
        """Return the error that ended the worker; None if it ended normally."""
        if self.block.state == ENDED:
            return None
        if self.block.state == FAILED:
            text, _, hint = self.block.failure.partition("\n  hint: ")  # the format of `str(error)`
            message = f"{self.task}{self._where()}: {text}"
            return TaskError(message, task=self.name, exit_code=exit_code, hint=hint)
        if self.block.state == NEW:
            return TaskError(
                f"{self.task}: its process {describe_exit(exit_code)} before it could start",
                task=self.name,
                exit_code=exit_code,
                hint="its output shows the cause. Each process imports the program's file, so put "
                'the code that starts the tasks under `if __name__ == "__main__":`',
            )
        return TaskError(
            f"{self.task} (process {self.process}) {describe_exit(exit_code)}{self._where()}",
            task=self.name,
            exit_code=exit_code,
            hint='on_failure="restart" restarts such a task. SIGKILL comes from another process, '
            "or from the kernel if memory runs out (see dmesg)",
        )

    def _where(self) -> str:
        if not self.block.counts[0]:
            return " before its first job"
        released = (self.block.release_ns - self.block.origin_ns) * 1e-9
        inside = "in" if self.block.busy else "after"
        return f" {inside} job {self.block.number}, released at {released:.6f} s"


def describe_exit(exit_code: int | None) -> str:
    if exit_code is not None and exit_code < 0:
        return f"was killed by {signal.Signals(-exit_code).name}"
    return f"ended with exit status {exit_code}"

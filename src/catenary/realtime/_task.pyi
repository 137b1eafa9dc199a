"""Compiled part of tasks: the memory that supervisor and task share, and the task's releases."""

from typing_extensions import Buffer

from catenary.realtime._clock import Timer

NEW: int
STARTED: int
ENDED: int
FAILED: int
BLOCK_SIZE: int
FIGURE_NAMES: tuple[str, ...]

class Block:
    """Memory of one task.

    The task's thread writes the job and the figures. Other threads request a stop, change the
    period and set signals.
    """

    def __init__(self, memory: Buffer, offset: int = 0) -> None: ...
    def prepare(self, period_ns: int, deadline_ns: int, sporadic: bool, skip: bool) -> None:
        """Initialise the block, and pre-fault its pages."""

    def restart(self) -> None:
        """Reset the state, process, failure and `busy` for a restart. The rest is unchanged."""

    def start_at(self, origin_ns: int) -> None:
        """Set the time of the first release, and end the wait in `wait_for_start`."""

    def wait_for_start(self, deadline_ns: int) -> bool:
        """Wait for `start_at` or `stop`. Return False at the deadline (CLOCK_MONOTONIC)."""

    def skip_to(self, now_ns: int) -> None:
        """Skip all releases that have passed, after a restart."""

    def wait_while(self, state: int, deadline_ns: int) -> None:
        """Wait for another state until the deadline (CLOCK_MONOTONIC). It may return early."""

    state: int
    process: int
    period_ns: int
    failure: str
    scheduling: str
    @property
    def stopped(self) -> bool: ...
    @property
    def deadline_ns(self) -> int: ...
    @property
    def origin_ns(self) -> int: ...
    @property
    def sporadic(self) -> bool: ...
    @property
    def busy(self) -> bool: ...
    @property
    def number(self) -> int: ...
    @property
    def release_ns(self) -> int: ...
    @property
    def counts(self) -> tuple[int, int, int, int]:
        """Numbers of jobs released, deadlines missed, releases skipped and signals refused."""

    def stop(self) -> None:
        """Request a stop: the task ends when it next waits.

        A caller in another thread must also wake the timer of the task.
        """

    def signal(self, now_ns: int) -> bool:
        """Release a sporadic task once. The caller must also wake the timer of the task.

        Return False if too many releases are pending. The new release is then dropped and counted.
        """

    def figure(self, number: int) -> tuple[int, float, int, int, float, float, float, float]:
        """Return count, mean, min, max, sd, p50, p99, p99.9 of figure `number` of FIGURE_NAMES."""

    def buckets(self, number: int) -> list[tuple[int, int, int]]:
        """Return (lower edge, upper edge, count) of every bucket that is not empty."""

class Releases:
    """Releases of one task. Only the thread of the task uses this object."""

    def __init__(self, block: Block, timer: Timer) -> None: ...
    def wait(self) -> bool:
        """Wait for the next release. Return False if a stop was requested."""

    def finish(self) -> bool:
        """End the current job, if any. Return True if it missed its deadline."""

    def spend(self, duration_ns: int) -> None: ...
    def count_collection(self, phase: str, info: dict[str, int]) -> None:
        """Count a run of the garbage collector; for gc.callbacks."""

    @property
    def number(self) -> int: ...
    @property
    def release_ns(self) -> int: ...
    @property
    def start_ns(self) -> int: ...

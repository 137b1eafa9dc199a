"""Tasks, compiled: their memory, seen by whoever started them; their releases, by themselves."""

from typing_extensions import Buffer

from catenary.realtime._clock import Timer

NEW: int
STARTED: int
ENDED: int
FAILED: int
BLOCK_SIZE: int
FIGURE_NAMES: tuple[str, ...]

class Block:
    """One task's memory. The task's thread writes the job and the figures; others stop it, change
    its period and signal it."""

    def __init__(self, memory: Buffer, offset: int = 0) -> None: ...
    def prepare(self, period_ns: int, deadline_ns: int, sporadic: bool, skip: bool) -> None:
        """Also touches every page."""

    def restart(self) -> None:
        """As new, but for the figures and the release reached."""

    def start_at(self, origin_ns: int) -> None:
        """The first release."""

    def wait_for_start(self, deadline_ns: int) -> bool:
        """Until `start_at` or `stop` is called; False: not by the deadline (CLOCK_MONOTONIC)."""

    def skip_to(self, now_ns: int) -> None:
        """The next release is the first one that has not passed: after a restart."""

    def wait_while(self, state: int, deadline_ns: int) -> None:
        """Until the state is another, or the deadline (CLOCK_MONOTONIC); may return sooner."""

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
        """Jobs released, deadlines missed, releases skipped, signals refused."""

    def stop(self) -> None:
        """The task ends when it waits; wake its timer too."""

    def signal(self, now_ns: int) -> bool:
        """Releases a sporadic task once; wake its timer too. False: too many wait already."""

    def figure(self, number: int) -> tuple[int, float, int, int, float, float, float, float]:
        """count, mean, min, max, sd, p50, p99, p99.9 of a figure, in the order of FIGURE_NAMES."""

    def buckets(self, number: int) -> list[tuple[int, int, int]]:
        """(lowest, lowest above, count) of every bucket that is not empty."""

class Releases:
    """The releases of one task, in its own thread."""

    def __init__(self, block: Block, timer: Timer) -> None: ...
    def wait(self) -> bool:
        """Until the next release; False: asked to stop."""

    def finish(self) -> bool:
        """Ends the running job, if there is one; True: after its deadline."""

    def spend(self, duration_ns: int) -> None: ...
    def count_collection(self, phase: str, info: dict[str, int]) -> None:
        """For gc.callbacks."""

    @property
    def number(self) -> int: ...
    @property
    def release_ns(self) -> int: ...
    @property
    def start_ns(self) -> int: ...

"""The virtual clock of tasks, and whoever takes part in it.

Time stands still while anybody runs and advances when every participant waits or spends execution
time. A participant is what a loop's segment needs of a clock: `now_ns`, `wait_until`, `spend`, and
`capsule` with the same as a C table (native/clock.h).
"""

from __future__ import annotations

from types import TracebackType
from typing import Self

from catenary.realtime._clock import (
    OWN_PROCESSOR,
    VIRTUAL_TIME_SIZE,
    VirtualTime,
    VirtualTimer,
)
from catenary.realtime.memory import SharedMemory

FIRST = 100  # before every task: they have 0 (ordinary scheduling) to 99


class Participant:
    """Owns one place on a virtual clock; one thread of one process uses it."""

    def __init__(self, memory: SharedMemory, slot: int) -> None:
        self._memory = memory
        self._time = VirtualTime(memory.buffer)
        self.timer = VirtualTimer(self._time, slot)

    def __reduce__(self) -> tuple[type[Participant], tuple[SharedMemory, int]]:
        return Participant, (self._memory, self.timer.slot)

    @property
    def now_ns(self) -> int:
        return self.timer.now_ns

    @property
    def capsule(self) -> object:
        """The C table of native/clock.h; it lives as long as this object."""
        return self.timer.capsule

    def wait_until(self, deadline_ns: int) -> bool:
        """True: the deadline has come; False: woken before it."""
        return self.timer.wait_until(deadline_ns)

    def spend(self, seconds: float) -> None:
        """Execution time [s], preempted by whoever precedes on the same processor."""
        self.timer.spend(round(seconds * 1e9))

    def wake(self) -> None:
        """Ends the running or the next wait; from any thread or process."""
        self.timer.wake()

    def expect(self) -> None:
        """Somebody will come, again: time stands still until then."""
        self._time.expect(self.timer.slot)

    def step_aside(self) -> None:
        """Time goes on without the participant, until it returns or waits."""
        self._time.step_aside(self.timer.slot)

    def return_to(self) -> None:
        """Time stands still until the participant waits: it runs."""
        self._time.run(self.timer.slot)

    def leave(self) -> None:
        self._time.remove(self.timer.slot)


class VirtualClock:
    """Owns a clock that advances only while all who take part in it wait. The thread that makes it
    takes part from the start: time passes in its `wait_until`, `spend` and in `Tasks.join`."""

    def __init__(self) -> None:
        self._memory = SharedMemory(VIRTUAL_TIME_SIZE)
        self._time = VirtualTime(self._memory.buffer)
        self._time.reset()
        self.home = self.participate(priority=FIRST)
        self.home.return_to()

    def participate(self, *, priority: int = 0, cpu: int | None = None) -> Participant:
        """A place for a loop or task; time stands still until it first waits.

        `cpu`: the simulated processor whose time it spends, shared with others by fixed priority
        (greater is higher); None: one of its own. ValueError: 64 take part already.
        """
        slot = self._time.join(priority, OWN_PROCESSOR if cpu is None else cpu)
        return Participant(self._memory, slot)

    @property
    def now_ns(self) -> int:
        return self._time.now_ns

    @property
    def capsule(self) -> object:
        """The C table of native/clock.h, of the thread that made the clock."""
        return self.home.capsule

    def wait_until(self, deadline_ns: int) -> bool:
        """Lets time pass for everybody, as the thread that made the clock. False: woken before."""
        return self.home.wait_until(deadline_ns)

    def spend(self, seconds: float) -> None:
        """Lets time pass as if this thread computed that long [s], on a processor of its own."""
        self.home.spend(seconds)

    def close(self) -> None:
        """Time goes on without the thread that made the clock."""
        self.home.leave()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

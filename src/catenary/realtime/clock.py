"""Virtual clock of tasks, and its participants.

Time stands still while any participant runs. It advances when every participant waits or spends
execution time. A participant has the clock interface of a loop's segment: `now_ns`, `wait_until`,
`spend`, and `capsule` with the same functions as a C table (native/clock.h).
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
from catenary.realtime.system.memory import SharedMemory

FIRST = 100  # above all priorities of tasks, 0 (ordinary scheduling) to 99


class Participant:
    """Owner of one slot of a virtual clock. One thread of one process uses it."""

    def __init__(self, memory: SharedMemory, slot: int) -> None:
        self._memory = memory
        self._time = VirtualTime(memory.buffer)
        self.timer = VirtualTimer(self._time, slot)

    def __reduce__(self) -> tuple[type[Participant], tuple[SharedMemory, int]]:
        return Participant, (self._memory, self.timer.slot)

    @property
    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self.timer.now_ns

    @property
    def capsule(self) -> object:
        """Capsule with the clock table (`native/clock.h`); valid while this object exists."""
        return self.timer.capsule

    def wait_until(self, deadline_ns: int) -> bool:
        """Wait. Return True if the deadline has passed, False if `wake` ended the wait."""
        return self.timer.wait_until(deadline_ns)

    def spend(self, seconds: float) -> None:
        """Spend execution time [s]. Higher priorities on the same processor preempt it."""
        self.timer.spend(round(seconds * 1e9))

    def wake(self) -> None:
        """End the current or the next wait. Any thread or process may call it."""
        self.timer.wake()

    def expect(self) -> None:
        """Stop the time until the restarted participant first waits."""
        self._time.expect(self.timer.slot)

    def step_aside(self) -> None:
        """Let time advance without the participant until it returns or waits."""
        self._time.step_aside(self.timer.slot)

    def return_to(self) -> None:
        """Mark the participant as running: time stands still until it waits."""
        self._time.run(self.timer.slot)

    def leave(self) -> None:
        """Remove the participant from the clock, and free its slot."""
        self._time.remove(self.timer.slot)


class VirtualClock:
    """Owner of a clock that advances only while all participants wait or spend execution time.

    The thread that creates the clock participates from the start. Time passes in its `wait_until`
    and `spend`, and in `Tasks.join`.
    """

    def __init__(self) -> None:
        self._memory = SharedMemory(VIRTUAL_TIME_SIZE)
        self._time = VirtualTime(self._memory.buffer)
        self._time.reset()
        self.home = self.participate(priority=FIRST)
        self.home.return_to()

    def participate(self, *, priority: int = 0, cpu: int | None = None) -> Participant:
        """Return a participant for a loop or task. Time stands still until it first waits.

        Args:
            priority: fixed priority on the simulated processor; greater is higher.
            cpu: simulated processor, which participants share by priority; None for its own.

        Raises:
            ValueError: the clock already has 64 participants.
        """
        slot = self._time.join(priority, OWN_PROCESSOR if cpu is None else cpu)
        return Participant(self._memory, slot)

    @property
    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self._time.now_ns

    @property
    def capsule(self) -> object:
        """Capsule with the clock table (`native/clock.h`) of the thread that created the clock."""
        return self.home.capsule

    def wait_until(self, deadline_ns: int) -> bool:
        """Wait in the thread that created the clock, while time passes for all participants.

        Return True if the deadline has passed, False if a wake-up ended the wait.
        """
        return self.home.wait_until(deadline_ns)

    def spend(self, seconds: float) -> None:
        """Let time pass as if this thread computed for `seconds` on its own processor."""
        self.home.spend(seconds)

    def close(self) -> None:
        """Remove the thread that created the clock from the participants."""
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

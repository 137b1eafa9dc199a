"""Timers of tasks on the machine's clock and on a virtual clock. Waits release the GIL."""

from typing_extensions import Buffer

FOREVER: int
OWN_PROCESSOR: int
PARTICIPANTS: int
MACHINE_TIMER_SIZE: int
VIRTUAL_TIME_SIZE: int

class Timer:
    """Timer of one thread. Other threads may only call `wake`."""

    @property
    def capsule(self) -> object:
        """Clock table of native/clock.h, for compiled code."""

    @property
    def now_ns(self) -> int: ...
    @property
    def is_virtual(self) -> bool: ...
    def wait_until(self, deadline_ns: int) -> bool:
        """Wait. Return True if the deadline has passed, False if `wake` ended the wait."""

    def spend(self, duration_ns: int) -> None:
        """Spend execution time: simulated on a virtual clock, real on the machine's clock.

        Raises ValueError for a negative duration.
        """

    def wake(self) -> None:
        """End the current or the next wait."""

class MachineTimer(Timer):
    def __init__(self, memory: Buffer, offset: int = 0) -> None: ...

class VirtualTime:
    """Table of the participants of a virtual clock, in shared memory."""

    def __init__(self, memory: Buffer) -> None: ...
    def reset(self) -> None:
        """Initialise the table. The memory must be all zeros. Raises OSError if this fails."""

    @property
    def now_ns(self) -> int: ...
    def join(self, priority: int, cpu: int) -> int:
        """Return a slot for a new participant. Time stands still until it first waits.

        Raises ValueError if all slots are in use.
        """

    def expect(self, slot: int) -> None:
        """Mark the participant as restarted: time stands still until it first waits."""

    def run(self, slot: int) -> None:
        """Mark the participant as running: time stands still until it waits."""

    def step_aside(self, slot: int) -> None:
        """Let time advance without the participant until it runs or waits again."""

    def remove(self, slot: int) -> None:
        """Remove the participant and free its slot."""

class VirtualTimer(Timer):
    slot: int
    def __init__(self, time: VirtualTime, slot: int) -> None: ...

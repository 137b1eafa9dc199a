"""Clocks of tasks: the machine's and the virtual one. What waits, waits without the GIL."""

from typing_extensions import Buffer

FOREVER: int
OWN_PROCESSOR: int
PARTICIPANTS: int
MACHINE_TIMER_SIZE: int
VIRTUAL_TIME_SIZE: int

class Timer:
    """One waiter on a clock. One thread uses it; only `wake` may be called by others."""

    @property
    def capsule(self) -> object:
        """The table of native/clock.h, for compiled code."""

    @property
    def now_ns(self) -> int: ...
    @property
    def is_virtual(self) -> bool: ...
    def wait_until(self, deadline_ns: int) -> bool:
        """True: the deadline has passed; False: woken before."""

    def spend(self, duration_ns: int) -> None:
        """Execution time: virtual: lets it pass; the machine's: computes that long."""

    def wake(self) -> None:
        """Ends the running or the next wait."""

class MachineTimer(Timer):
    def __init__(self, memory: Buffer, offset: int = 0) -> None: ...

class VirtualTime:
    """The table of participants of a virtual clock, in shared memory."""

    def __init__(self, memory: Buffer) -> None: ...
    def reset(self) -> None:
        """Makes a table of memory that is all zeros."""

    @property
    def now_ns(self) -> int: ...
    def join(self, priority: int, cpu: int) -> int:
        """A slot for somebody who is expected: time stands still until then."""

    def expect(self, slot: int) -> None:
        """As after `join`: somebody will come to this slot, again."""

    def run(self, slot: int) -> None:
        """The participant runs: time stands still until it waits."""

    def step_aside(self, slot: int) -> None:
        """Time goes on without the participant, until it runs or waits again."""

    def remove(self, slot: int) -> None:
        """The participant is gone; its slot is free."""

class VirtualTimer(Timer):
    slot: int
    def __init__(self, time: VirtualTime, slot: int) -> None: ...

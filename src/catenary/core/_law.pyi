"""A law in the cycle: its numbers, its budget, and what ended it."""

from collections.abc import Sequence
from typing import Final

# `Law.status`; 0: not taken over by the cycle yet. Every status but these two stopped the drives.
LAW_RUNNING: Final[int]
LAW_FINISHED: Final[int]  # it returned "finished": the axes hold
LAW_STOPPED: Final[int]  # by `stop_law`, or by another law: the axes hold
LAW_RAISED: Final[int]
LAW_NEVER_RETURNED: Final[int]  # it was given up
LAW_NOT_FINITE: Final[int]  # the set-point of `axis` was NaN or infinite
LAW_OVERRUN: Final[int]  # `overrun_limit` steps in a row took longer than the budget
LAW_ABORTED: Final[int]  # `Law.rehearse`: a step never returned

class Law:
    """A function of native/law.h at `address`, with its numbers.

    `memory`: the law's own, `parameters`: the application's; at most 4096 each. `budget_ns` of one
    step, 0: none; `overrun_limit` steps in a row over it stop the drives. A step that computes for
    20 ms (twice the budget, if that is more) is given up by a thread of `priority` (SCHED_FIFO; 0: as
    the caller). The laws of an engine share this thread; the first one sets its priority. The caller keeps what the address belongs to alive. ValueError, OSError.
    """

    def __init__(
        self,
        address: int,
        memory: Sequence[float],
        parameters: Sequence[float],
        *,
        budget_ns: int,
        overrun_limit: int,
        priority: int,
    ) -> None: ...
    def set_memory(self, values: Sequence[float]) -> None:
        """All at once, before the next step. ValueError for another number of numbers."""

    def set_parameters(self, values: Sequence[float]) -> None: ...
    @property
    def memory(self) -> list[float]:
        """As the last step left it."""

    @property
    def status(self) -> int: ...
    @property
    def ended(self) -> bool: ...
    @property
    def axis(self) -> int:
        """LAW_NOT_FINITE: whose set-point."""

    @property
    def figures(self) -> dict[str, int]:
        """steps, overruns, longest_ns."""

    def wait(self, timeout_ns: int) -> bool:
        """Waits for the end, without the GIL. Whether it has ended."""

    def rehearse(self, actual: bytes, target: bytes) -> int:
        """A few steps on copies of the blocks and of the memory: what is slow the first time happens
        now. What the law returned last (native/law.h). OSError if the thread that watches it cannot
        be started."""

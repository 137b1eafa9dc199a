"""Law in the cycle: its memory and parameters, its budget, and its end."""

from collections.abc import Sequence
from typing import Final

# Values of `Law.status`; 0: the cycle has not started the law yet. After LAW_FINISHED and
# LAW_STOPPED the axes hold; all other ends stop the drives.
LAW_RUNNING: Final[int]
LAW_FINISHED: Final[int]  # the law returned "finished": the axes hold
LAW_STOPPED: Final[int]  # stopped by `stop_law` or by another law: the axes hold
LAW_RAISED: Final[int]
LAW_NEVER_RETURNED: Final[int]  # aborted by the monitor
LAW_NOT_FINITE: Final[int]  # the set-point of `axis` was NaN or infinite
LAW_OVERRUN: Final[int]  # `overrun_limit` steps in a row exceeded the budget
LAW_ABORTED: Final[int]  # returned by `Law.rehearse`: the monitor aborted a step

class Law:
    """Compiled function (native/law.h) with its memory and parameters.

    A step that computes for 20 ms (twice the budget, if that is more) is aborted by a monitor
    thread. The laws of an engine share this thread; the first one sets its priority. The caller
    keeps the owner of `address` alive.

    Args:
        address: Address of the function.
        memory: Initial memory of the law, at most 4096 numbers.
        parameters: Parameters set by the application, at most 4096 numbers.
        budget_ns: Budget of one step [ns]; 0: none.
        overrun_limit: Number of steps in a row over the budget that stop the drives.
        priority: SCHED_FIFO priority of the monitor; 0: that of the caller.

    Raises:
        ValueError: A number is out of range.
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
        """Replace the memory before the next step. Raises ValueError if the length differs."""

    def set_parameters(self, values: Sequence[float]) -> None: ...
    @property
    def memory(self) -> list[float]:
        """Memory after the last step.

        If the law runs in a native thread, reading waits for its next step, for at most 0.2 s.
        After this time, it is the last copy of the memory.
        """

    @property
    def status(self) -> int: ...
    @property
    def ended(self) -> bool: ...
    @property
    def axis(self) -> int:
        """Number of the axis with an invalid set-point, for LAW_NOT_FINITE."""

    @property
    def figures(self) -> dict[str, int]:
        """Counts of steps and overruns, and the longest step: steps, overruns, longest_ns."""

    def wait(self, timeout_ns: int) -> bool:
        """Wait for the end of the law, without the GIL; return True if it has ended.

        A signal or a spurious wake-up ends the wait early.
        """

    def rehearse(self, actual: bytes, target: bytes) -> int:
        """Run at most three steps on copies of the targets and of the memory, to warm the caches.

        The time of each step is 0. A step that the monitor aborts is the last one.

        Args:
            actual: Block of the actual values.
            target: Block of the targets.

        Returns:
            The last return value of the law (native/law.h).

        Raises:
            OSError: The monitor thread cannot be started.
        """

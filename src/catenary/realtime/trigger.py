"""Signal: trigger of a sporadic task. Any thread or process that has the signal can set it."""

from __future__ import annotations

from catenary.realtime._clock import Timer
from catenary.realtime._task import Block
from catenary.realtime.task_memory import Place


class Signal:
    """Trigger of one sporadic task.

    `Task(..., trigger=signal)` waits for it. Tasks that receive it as an argument can set it.
    """

    def __init__(self) -> None:
        self._place: Place | None = None
        self._ends: tuple[Block, Timer] | None = None

    def __getstate__(self) -> Place | None:
        return self._place

    def __setstate__(self, place: Place | None) -> None:
        self._place, self._ends = place, None

    def bind(self, place: Place) -> None:
        """Connect the signal to its task. `Tasks` calls this before the tasks start."""
        self._place, self._ends = place, None

    def set(self) -> bool:
        """Release the task once, as soon as its period allows. This never blocks.

        Return False if 64 releases are already pending. The new release is then dropped and
        counted. Raises RuntimeError if no task has this trigger.
        """
        if self._ends is None:
            if self._place is None:
                raise RuntimeError("no task was started with this signal as its trigger")
            self._ends = Block(self._place.memory.buffer), self._place.open_timer()
        block, timer = self._ends
        kept = block.signal(timer.now_ns)
        timer.wake()
        return kept

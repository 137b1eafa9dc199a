"""Signal: what a sporadic task sleeps for. Anybody who has it can set it: any task, any process."""

from __future__ import annotations

from catenary.realtime._clock import Timer
from catenary.realtime._task import Block
from catenary.realtime.task_memory import Place


class Signal:
    """Owns the way to one sporadic task. `Task(..., trigger=signal)` waits for it; whoever else
    has it, by its own arguments, sets it."""

    def __init__(self) -> None:
        self._place: Place | None = None
        self._ends: tuple[Block, Timer] | None = None

    def __getstate__(self) -> Place | None:
        return self._place

    def __setstate__(self, place: Place | None) -> None:
        self._place, self._ends = place, None

    def bind(self, place: Place) -> None:
        """Called by `Tasks` before the tasks start."""
        self._place, self._ends = place, None

    def set(self) -> bool:
        """Releases the task once, as soon as its period allows. False: 64 releases wait already,
        and this one is not kept (counted). Never waits. RuntimeError: no task has this trigger."""
        if self._ends is None:
            if self._place is None:
                raise RuntimeError("no task was started with this signal as its trigger")
            self._ends = Block(self._place.memory.buffer), self._place.open_timer()
        block, timer = self._ends
        kept = block.signal(timer.now_ns)
        timer.wake()
        return kept

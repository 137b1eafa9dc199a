"""Place: the shared memory of a task and its participant on a clock, passed to its process."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.realtime._clock import MachineTimer, Timer
from catenary.realtime.clock import Participant
from catenary.realtime.system.memory import SharedMemory


@dataclass(frozen=True, slots=True)
class Place:
    memory: SharedMemory  # a Block, which begins with the memory of a MachineTimer
    participant: Participant | None  # None on the machine's clock

    def open_timer(self) -> Timer:
        """Return the task's timer. Any process can use it to wake the task."""
        if self.participant is not None:
            return self.participant.timer
        return MachineTimer(self.memory.buffer)

"""Place: the memory of a task and its participant on a clock. Passed to its process."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.realtime._clock import MachineTimer, Timer
from catenary.realtime.clock import Participant
from catenary.realtime.system.memory import SharedMemory


@dataclass(frozen=True, slots=True)
class Place:
    memory: SharedMemory  # a Block; it begins with the machine's timer
    participant: Participant | None  # on a virtual clock

    def open_timer(self) -> Timer:
        """Return the task's timer; any process can use it to wake the task."""
        if self.participant is not None:
            return self.participant.timer
        return MachineTimer(self.memory.buffer)

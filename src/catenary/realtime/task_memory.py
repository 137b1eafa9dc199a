"""Place: where a task lives: its memory, and its waiter on a clock. Handed to its process."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.realtime._clock import MachineTimer, Timer
from catenary.realtime.clock import Participant
from catenary.realtime.memory import SharedMemory


@dataclass(frozen=True, slots=True)
class Place:
    memory: SharedMemory  # a Block; it begins with the machine's timer
    participant: Participant | None  # on a virtual clock

    def open_timer(self) -> Timer:
        """The task's waiter; in any process: to be woken."""
        if self.participant is not None:
            return self.participant.timer
        return MachineTimer(self.memory.buffer)

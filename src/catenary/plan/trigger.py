"""Trigger: interface to the memory with which a loop starts the cycles of loops elsewhere.

`loop` and `share` have this interface in common, as with `Sink`.
"""

from __future__ import annotations

import mmap
from typing import Protocol


class Trigger(Protocol):
    """Trigger that a loop sends to other processes, or awaits from one."""

    @property
    def name(self) -> str:
        """Name of the trigger."""

    @property
    def sends(self) -> bool:
        """True if the loop sends the trigger; False if it awaits it."""

    def open(self) -> mmap.mmap:
        """Return the shared memory of native/trigger.h. A loop calls this before its first cycle.

        Raises:
            ShareError: The memory cannot be opened, or another loop sends this trigger.
        """

    def close(self) -> None:
        """Release the trigger for another sender. Another `open` may follow."""

"""Triggers: the loop of one process starts the cycles of loops in other processes.

The memory is a file in the folder of the user. It remains after the end of the programs, so that a
sender that is started again continues in the memory of its receivers. The kernel releases the
sender's lock when its process ends.
"""

from __future__ import annotations

import fcntl
import mmap
import os

from catenary.core import TRIGGER_SIZE
from catenary.errors import ShareError
from catenary.share.folder import deciding, file_name, own_folder, prepare
from catenary.share.memory import Segment, create, open_segment

TRIGGER = "trigger"  # prefix of file names
MODE = 0o600  # a program that can write the memory can delay the cycles of the receivers


class TriggerReceiver:
    """Trigger that a loop awaits: `Loop(trigger=cat.share.TriggerReceiver("body"))`.

    Args:
        name: Name of the trigger.

    Raises:
        ValueError: The name is invalid.
    """

    sends = False

    def __init__(self, name: str) -> None:
        file_name(TRIGGER, name)
        self.name = name

    def open(self) -> mmap.mmap:
        """Map the memory, and create it if it does not exist.

        Raises ShareError if the memory is invalid.
        """
        return open_memory(self.name).memory

    def close(self) -> None:
        """Do nothing: the loop keeps the memory as long as it uses it."""


class TriggerSender:
    """Trigger that a loop sends: `Loop(trigger=cat.share.TriggerSender("body"))`.

    Each cycle of the loop starts a cycle of the loops that await the trigger. The loop never waits
    for them.

    Args:
        name: Name of the trigger.

    Raises:
        ValueError: The name is invalid.
    """

    sends = True

    def __init__(self, name: str) -> None:
        file_name(TRIGGER, name)
        self.name = name
        self._lock: int | None = None  # descriptor that holds the lock of the file

    def open(self) -> mmap.mmap:
        """Map the memory, and lock it against other senders.

        Raises:
            ShareError: Another loop sends this trigger, or the memory is invalid.
        """
        self.close()
        segment = open_memory(self.name)
        self._lock = os.open(segment.path, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            self.close()
            raise ShareError(
                f"another loop already sends the trigger {self.name!r}",
                hint="end that program, or use another name",
            ) from error
        return segment.memory

    def close(self) -> None:
        """Release the lock; a second call has no effect."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def open_memory(name: str) -> Segment:
    """Map the memory of a trigger, and create it if it does not exist.

    Raises:
        ShareError: The file is not the memory of a trigger.
    """
    folder = own_folder()
    prepare(folder, MODE)
    path = folder / file_name(TRIGGER, name)
    with deciding(folder):
        try:
            segment = open_segment(path, (os.geteuid(),), writable=True, granted=MODE)
        except FileNotFoundError:
            segment = create(folder, TRIGGER_SIZE, MODE)
            segment.publish(path)
    if segment.size != TRIGGER_SIZE:
        raise ShareError(
            f"{path} has {segment.size} bytes, expected {TRIGGER_SIZE}",
            hint="another version of Catenary made it: end its programs, and remove the file",
        )
    return segment

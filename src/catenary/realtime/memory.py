"""Memory that tasks in other processes see too: anonymous, so that nothing is left behind by
whoever is killed."""

from __future__ import annotations

import mmap
import os
import weakref
from multiprocessing import context, reduction
from typing import Protocol


class Descriptor(Protocol):
    """What multiprocessing makes of a file descriptor on its way to a child."""

    def detach(self) -> int: ...


class SharedMemory:
    """Owns one piece of memory, zeros at first, every page there. It is handed to a child process
    as an argument, and ends with the last process that has it."""

    def __init__(self, size: int, *, descriptor: int | None = None) -> None:
        if size <= 0:
            raise ValueError(f"a size of {size} bytes is not positive")
        if descriptor is None:
            descriptor = os.memfd_create("catenary", os.MFD_CLOEXEC)
            os.ftruncate(descriptor, size)
        self._descriptor = descriptor
        weakref.finalize(self, os.close, descriptor)
        self.size = size
        self.buffer = mmap.mmap(descriptor, size, flags=mmap.MAP_SHARED | mmap.MAP_POPULATE)

    def __reduce__(self) -> tuple[object, tuple[object, int]]:
        if context.get_spawning_popen() is None:
            raise TypeError("shared memory goes to another process only as an argument of its task")
        return attach, (reduction.DupFd(self._descriptor), self.size)


def attach(descriptor: Descriptor, size: int) -> SharedMemory:
    """The same memory, in the child."""
    return SharedMemory(size, descriptor=descriptor.detach())

"""Anonymous memory shared with tasks in other processes. It leaves no file behind."""

from __future__ import annotations

import mmap
import os
import weakref
from multiprocessing import context, reduction
from typing import Protocol


class Descriptor(Protocol):
    """The form in which multiprocessing passes a file descriptor to a child."""

    def detach(self) -> int: ...


class SharedMemory:
    """Owner of pre-faulted memory that starts as zeros.

    Pass it to a child process as an argument. It is freed when no process maps it any more.
    """

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
            raise TypeError("shared memory can only be passed as an argument when a process starts")
        return attach, (reduction.DupFd(self._descriptor), self.size)


def attach(descriptor: Descriptor, size: int) -> SharedMemory:
    """Map the same memory in the child."""
    return SharedMemory(size, descriptor=descriptor.detach())

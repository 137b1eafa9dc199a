"""The calls of the C library that Python lacks. OSError: refused."""

from __future__ import annotations

import ctypes
import os

M_TRIM_THRESHOLD, M_MMAP_MAX = -1, -4  # malloc.h
TRIM_THRESHOLD, MMAP_MAX = 128 * 1024, 65536  # as they are at the start, mallopt(3)
PR_SET_TIMERSLACK, PR_GET_TIMERSLACK = 29, 30  # linux/prctl.h
PR_SET_PDEATHSIG = 1


def call(name: str, *arguments: int) -> int:
    """A function of ints and longs that returns -1 and errno where it fails."""
    function = getattr(ctypes.CDLL(None, use_errno=True), name, None)
    if function is None:
        raise OSError(0, f"this C library has no {name}")
    result = int(function(*map(ctypes.c_long, arguments)))
    if result == -1:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return result


def unlock_all_memory() -> None:
    call("munlockall")


def timer_slack_ns() -> int:
    """Of the calling thread."""
    return call("prctl", PR_GET_TIMERSLACK, 0, 0, 0, 0)


def change_timer_slack(ns: int) -> None:
    """By how much the kernel may delay this thread's wake-ups; the ordinary is 50 us."""
    call("prctl", PR_SET_TIMERSLACK, ns, 0, 0, 0)


def signal_on_parents_death(number: int) -> None:
    call("prctl", PR_SET_PDEATHSIG, number, 0, 0, 0)


def change_malloc(trim_threshold: int, mmap_max: int) -> None:
    """When the heap gives memory back, and how many allocations may be mappings of their own."""
    for option, value in ((M_TRIM_THRESHOLD, trim_threshold), (M_MMAP_MAX, mmap_max)):
        if call("mallopt", option, value) != 1:
            raise OSError(0, "mallopt refused")


def trim_heap() -> None:
    call("malloc_trim", 0)


def touch_heap(size: int) -> None:
    """Has the kernel give the heap `size` bytes now rather than page by page later."""
    libc = ctypes.CDLL(None)
    libc.malloc.restype = ctypes.c_void_p
    libc.free.argtypes = [ctypes.c_void_p]
    memory = libc.malloc(ctypes.c_size_t(size))
    if not memory:
        raise OSError(0, f"{size} bytes of heap are not to be had")
    ctypes.memset(memory, 0, size)
    libc.free(memory)

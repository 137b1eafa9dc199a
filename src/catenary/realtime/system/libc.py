"""C library functions that Python lacks. They raise OSError if they fail."""

from __future__ import annotations

import ctypes
import os

M_TRIM_THRESHOLD, M_MMAP_MAX = -1, -4  # malloc.h
TRIM_THRESHOLD, MMAP_MAX = 128 * 1024, 65536  # defaults, mallopt(3)
PR_SET_TIMERSLACK, PR_GET_TIMERSLACK = 29, 30  # linux/prctl.h
PR_SET_PDEATHSIG = 1


def call(name: str, *arguments: int) -> int:
    """Call a C function with arguments of type long, and return its result.

    The C function must return -1 and set errno on failure.

    Args:
        name: name of the function.
        arguments: arguments of the function.

    Raises:
        OSError: the call failed, or this C library lacks the function.
    """
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
    """Return the timer slack [ns] of the calling thread."""
    return call("prctl", PR_GET_TIMERSLACK, 0, 0, 0, 0)


def change_timer_slack(ns: int) -> None:
    """Set the longest delay [ns] that the kernel may add to wake-ups of the calling thread."""
    call("prctl", PR_SET_TIMERSLACK, ns, 0, 0, 0)


def signal_on_parents_death(number: int) -> None:
    call("prctl", PR_SET_PDEATHSIG, number, 0, 0, 0)


def change_malloc(trim_threshold: int, mmap_max: int) -> None:
    """Set how much free heap malloc keeps [bytes], and its maximum number of mmap allocations."""
    for option, value in ((M_TRIM_THRESHOLD, trim_threshold), (M_MMAP_MAX, mmap_max)):
        if call("mallopt", option, value) != 1:
            raise OSError(0, f"mallopt({option}, {value}) failed")


def trim_heap() -> None:
    call("malloc_trim", 0)


def touch_heap(size: int) -> None:
    """Allocate and pre-fault `size` bytes of heap, so that later allocations cause no faults."""
    libc = ctypes.CDLL(None)
    libc.malloc.restype = ctypes.c_void_p
    libc.free.argtypes = [ctypes.c_void_p]
    memory = libc.malloc(ctypes.c_size_t(size))
    if not memory:
        raise OSError(0, f"cannot allocate {size} bytes of heap")
    ctypes.memset(memory, 0, size)
    libc.free(memory)

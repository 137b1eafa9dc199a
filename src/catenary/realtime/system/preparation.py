"""`with realtime.session():` prepare a process for real time, and undo all changes at the end."""

from __future__ import annotations

import contextlib
import gc
import os
import struct
import sys
from collections.abc import Callable
from types import TracebackType
from typing import Self

from catenary.errors import RealtimeError
from catenary.interpreter import permission_advice
from catenary.realtime._stack import touch_stack
from catenary.realtime.system import libc
from catenary.realtime.system.scheduling import lock_all_memory, locked_kilobytes

TOUCHED_STACK = 128 * 1024  # [bytes], as in the core's own thread
LATENCY_DEVICE = "/dev/cpu_dma_latency"
SET_CAPABILITIES = permission_advice()

HOW_TO_GET = {
    "locked memory": f"run as root, or once: {SET_CAPABILITIES}; or `ulimit -l unlimited` by a "
    "memlock line in /etc/security/limits.d",
    "CPU latency": f"run as root, or let a udev rule open {LATENCY_DEVICE}: KERNEL=="
    '"cpu_dma_latency", MODE="0660", GROUP="realtime"',
    "heap": "use glibc, which has mallopt and malloc_trim",
    "timer slack": "use Linux 2.6.28 or newer",
}

Undo = contextlib.ExitStack


class Session:
    """Owner of the real-time settings of a process inside a `with` block."""

    def __init__(self, heap_size: int, switch_interval: float, best_effort: bool) -> None:
        if heap_size < 0:
            raise ValueError(f"a heap of {heap_size} bytes is negative")
        if not 1e-6 <= switch_interval <= 1.0:
            raise ValueError(f"a switch interval of {switch_interval} s is not within 1e-6 to 1")
        self.heap_size = heap_size
        self.switch_interval = switch_interval
        self.best_effort = best_effort
        self.refusals: tuple[str, ...] = ()
        self._undo: Undo | None = None

    def __reduce__(self) -> tuple[type[Session], tuple[int, float, bool]]:
        return Session, (self.heap_size, self.switch_interval, self.best_effort)

    def __enter__(self) -> Self:
        if self._undo is not None:
            raise RuntimeError("this session has already begun; make one session for each block")
        with contextlib.ExitStack() as undo:
            refused = list(filter(None, (attempt(*step, undo) for step in self._steps())))
            if refused and not self.best_effort:
                raise RealtimeError(
                    "; ".join(f"{what} refused ({why})" for what, why in refused),
                    hint="; ".join(f"{what}: {HOW_TO_GET[what]}" for what, _ in refused)
                    + "; or continue without them by best_effort=True",
                )
            self.refusals = tuple(f"{what} refused ({why})" for what, why in refused)
            self._undo = undo.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        undo, self._undo = self._undo, None
        if undo is not None:
            undo.close()

    def _steps(self) -> list[tuple[str, Callable[[Undo], None]]]:
        return [
            ("garbage collector", freeze_collector),
            ("switch interval", self._change_switch_interval),
            ("heap", self._keep_heap),
            ("timer slack", sharpen_timers),
            ("CPU latency", hold_latency),
            ("locked memory", lock_memory),
        ]

    def _change_switch_interval(self, undo: Undo) -> None:
        """Set how long a Python thread may keep the interpreter from others (default 5 ms)."""
        # Python rounds down to whole microseconds: adding half of one restores the same value.
        undo.callback(sys.setswitchinterval, sys.getswitchinterval() + 0.5e-6)
        sys.setswitchinterval(self.switch_interval)

    def _keep_heap(self, undo: Undo) -> None:
        """Keep freed memory in the heap and pre-fault it: malloc causes no page faults."""
        undo.callback(libc.trim_heap)
        undo.callback(libc.change_malloc, libc.TRIM_THRESHOLD, libc.MMAP_MAX)
        libc.change_malloc(-1, 0)
        libc.touch_heap(self.heap_size)


def session(
    *, heap_size: int = 16 * 2**20, switch_interval: float = 1e-4, best_effort: bool = False
) -> Session:
    """Return a context manager that prepares this process for real time.

    It locks and pre-faults memory, freezes and disables the garbage collector, and keeps the
    processors from deep sleep. Timers become precise for this thread and the threads it starts.
    The end of the block undoes all changes.

    Args:
        heap_size: heap that malloc keeps [bytes].
        switch_interval: how long a Python thread may keep the interpreter from others [s].
        best_effort: list refused settings in `refusals` instead of raising.

    Raises:
        RealtimeError: on entering, if a setting is refused; the hint says how to get it.
        ValueError: `heap_size` or `switch_interval` is out of range.
    """
    return Session(heap_size, switch_interval, best_effort)


def attempt(what: str, step: Callable[[Undo], None], undo: Undo) -> tuple[str, str] | None:
    """Run a step. If it is refused, undo it and return its name and the reason."""
    try:
        with contextlib.ExitStack() as own:
            step(own)
            undo.push(own.pop_all())
    except OSError as error:
        return what, error.strerror or str(error)
    return None


def freeze_collector(undo: Undo) -> None:
    """Freeze all present objects and disable the garbage collector until the end."""
    if gc.isenabled():
        undo.callback(gc.enable)
    if gc.get_freeze_count() == 0:
        undo.callback(gc.unfreeze)
        gc.collect()
        gc.freeze()
    gc.disable()


def sharpen_timers(undo: Undo) -> None:
    undo.callback(libc.change_timer_slack, libc.timer_slack_ns())
    libc.change_timer_slack(1)


def hold_latency(undo: Undo) -> None:
    """Keep processors from deep sleep while the device is open: the kernel's PM QoS interface."""
    device = os.open(LATENCY_DEVICE, os.O_WRONLY)
    undo.callback(os.close, device)
    os.write(device, struct.pack("=i", 0))


def lock_memory(undo: Undo) -> None:
    touch_stack(TOUCHED_STACK)
    if locked_kilobytes() == 0:
        undo.callback(libc.unlock_all_memory)
    lock_all_memory()

"""Session: prepare a process for real time, and undo all changes at the end of the block."""

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

REMEDIES = {
    "locked memory": f"run as root, or run once: {SET_CAPABILITIES}; or add an unlimited memlock "
    "line to /etc/security/limits.d",
    "CPU latency": f"run as root, or permit {LATENCY_DEVICE} to a group: "
    'echo \'KERNEL=="cpu_dma_latency", MODE="0660", GROUP="realtime"\' | sudo tee '
    "/etc/udev/rules.d/99-cpu-dma-latency.rules; sudo udevadm control --reload; sudo udevadm "
    "trigger; then join that group: sudo usermod -aG realtime $USER",
    "heap": "use glibc, which has mallopt and malloc_trim",
    "timer slack": "use Linux 2.6.28 or newer",
}

Undo = contextlib.ExitStack


class Session:
    """Owner of the real-time settings of a process inside a `with` block."""

    def __init__(self, heap_size: int, switch_interval: float, best_effort: bool) -> None:
        if heap_size < 0:
            raise ValueError(f"heap_size must not be negative: {heap_size} bytes")
        if not 1e-6 <= switch_interval <= 1.0:
            raise ValueError(f"switch_interval {switch_interval} s is not within 1e-6 to 1 s")
        self.heap_size = heap_size
        self.switch_interval = switch_interval
        self.best_effort = best_effort
        self.refusals: tuple[str, ...] = ()
        self._undo: Undo | None = None

    def __reduce__(self) -> tuple[type[Session], tuple[int, float, bool]]:
        return Session, (self.heap_size, self.switch_interval, self.best_effort)

    def __enter__(self) -> Self:
        if self._undo is not None:
            raise RuntimeError(
                "this session is already active; create one session for each `with` block"
            )
        with contextlib.ExitStack() as undo:
            refused = list(filter(None, (attempt(*step, undo) for step in self._steps())))
            if refused and not self.best_effort:
                raise RealtimeError(
                    "; ".join(f"{what} refused ({why})" for what, why in refused),
                    hint="; ".join(f"{what}: {REMEDIES[what]}" for what, _ in refused)
                    + "; or set best_effort=True to continue without them",
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
        """Set how long a Python thread may hold the interpreter lock (Python's default is 5 ms)."""
        # Python rounds down to whole microseconds, so add 0.5 us to restore the same value.
        undo.callback(sys.setswitchinterval, sys.getswitchinterval() + 0.5e-6)
        sys.setswitchinterval(self.switch_interval)

    def _keep_heap(self, undo: Undo) -> None:
        """Pre-fault the heap and keep freed memory in it, so that malloc causes no page faults."""
        undo.callback(libc.trim_heap)
        undo.callback(libc.change_malloc, libc.TRIM_THRESHOLD, libc.MMAP_MAX)
        libc.change_malloc(-1, 0)
        libc.touch_heap(self.heap_size)


def session(
    *, heap_size: int = 16 * 2**20, switch_interval: float = 1e-4, best_effort: bool = False
) -> Session:
    """Return a context manager that prepares this process for real time.

    It locks and pre-faults memory, freezes and disables the garbage collector, and prevents deep
    sleep of the processors. Timers become precise for this thread and the threads it starts. The
    end of the block undoes all changes.

    Args:
        heap_size: heap to pre-fault and keep [bytes].
        switch_interval: longest time for which a Python thread may hold the interpreter lock [s].
        best_effort: True to list refused settings in `refusals` instead of raising an exception.

    Raises:
        RealtimeError: at the start of the block, if a setting is refused. The hint names a remedy.
        ValueError: `heap_size` or `switch_interval` is out of range.
    """
    return Session(heap_size, switch_interval, best_effort)


def attempt(what: str, step: Callable[[Undo], None], undo: Undo) -> tuple[str, str] | None:
    """Run a step, and return None.

    If the step raises OSError, undo it and return its name and the reason.
    """
    try:
        with contextlib.ExitStack() as own:
            step(own)
            undo.push(own.pop_all())
    except OSError as error:
        return what, error.strerror or str(error)
    return None


def freeze_collector(undo: Undo) -> None:
    """Freeze all existing objects and disable the garbage collector."""
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
    """Prevent deep sleep of the processors through the kernel's PM QoS interface."""
    device = os.open(LATENCY_DEVICE, os.O_WRONLY)
    undo.callback(os.close, device)
    os.write(device, struct.pack("=i", 0))


def lock_memory(undo: Undo) -> None:
    touch_stack(TOUCHED_STACK)
    if locked_kilobytes() == 0:
        undo.callback(libc.unlock_all_memory)
    lock_all_memory()

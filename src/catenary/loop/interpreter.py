"""Switch interval of the interpreter while inline loops are open.

A thread that needs the interpreter waits for the switch interval (5 ms in CPython). Then the thread
that holds the interpreter must release it. A busy second thread delays an inline loop by this time.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

HALF_A_MICROSECOND = 0.5e-6  # CPython keeps whole microseconds and truncates the rest

_lock = threading.Lock()  # for the two variables below
_requested: list[float] = []
_before = 0.0


@contextmanager
def switch_interval(seconds: float) -> Iterator[None]:
    """Set the switch interval to the shortest requested one. The last exit restores the former one.

    Args:
        seconds: Requested switch interval [s].
    """
    global _before
    with _lock:
        if not _requested:
            _before = sys.getswitchinterval()
        _requested.append(seconds)
        sys.setswitchinterval(min(_requested) + HALF_A_MICROSECOND)
    try:
        yield
    finally:
        with _lock:
            _requested.remove(seconds)
            sys.setswitchinterval((min(_requested) if _requested else _before) + HALF_A_MICROSECOND)

"""The interpreter's switch interval while inline loops are open.

A thread that needs the interpreter waits for the switch interval (5 ms in CPython). Then the thread
that holds the interpreter must release it. A busy second thread delays an inline loop as long.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

HALF_A_MICROSECOND = 0.5e-6  # CPython keeps whole microseconds and truncates the rest

_lock = threading.Lock()  # for the two variables below
_wanted: list[float] = []
_before = 0.0


@contextmanager
def switch_interval(seconds: float) -> Iterator[None]:
    """Set the switch interval [s]: the shortest of nested ones; the last exit restores it."""
    global _before
    with _lock:
        if not _wanted:
            _before = sys.getswitchinterval()
        _wanted.append(seconds)
        sys.setswitchinterval(min(_wanted) + HALF_A_MICROSECOND)
    try:
        yield
    finally:
        with _lock:
            _wanted.remove(seconds)
            sys.setswitchinterval((min(_wanted) if _wanted else _before) + HALF_A_MICROSECOND)

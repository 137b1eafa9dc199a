"""How long other Python threads keep the interpreter from a loop that iterates inline.

A thread that wants the interpreter waits for a switch interval, 5 ms in CPython, before whoever has
it is asked to give it up. An inline loop asks for it a lead, 50 us, before its instant.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

SWITCH_INTERVAL = 20e-6  # [s]
HALF_A_MICROSECOND = 0.5e-6  # CPython keeps whole ones, and cuts off what is beyond

_lock = threading.Lock()  # of the two below
_loops = 0
_before = 0.0


@contextmanager
def prompt_interpreter() -> Iterator[None]:
    """A short switch interval as long as any loop wants it; then what it was before the first."""
    global _loops, _before
    with _lock:
        _loops += 1
        if _loops == 1:
            _before = sys.getswitchinterval()
            sys.setswitchinterval(min(_before, SWITCH_INTERVAL) + HALF_A_MICROSECOND)
    try:
        yield
    finally:
        with _lock:
            _loops -= 1
            if _loops == 0:
                sys.setswitchinterval(_before + HALF_A_MICROSECOND)

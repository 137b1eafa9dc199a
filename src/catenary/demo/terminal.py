"""A key that a person can hit while a program runs."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def on_enter(action: Callable[[], object], *, source: int | None = None) -> Iterator[bool]:
    """Within the block Enter at the terminal calls `action()`, in a thread that sleeps until then.

    `source`: a file descriptor to read lines from; None: standard input, if that is a terminal.
    Yields whether anybody can: without a terminal nothing is read.
    """
    descriptor = terminal() if source is None else source
    if descriptor is None:
        yield False
        return
    woken, wake = os.pipe()
    thread = threading.Thread(target=_listen, args=(descriptor, woken, action), daemon=True)
    thread.start()
    try:
        yield True
    finally:
        os.close(wake)
        thread.join()
        os.close(woken)


def terminal() -> int | None:
    """Standard input, where a person sits at it."""
    return sys.stdin.fileno() if sys.stdin is not None and sys.stdin.isatty() else None


def _listen(descriptor: int, woken: int, action: Callable[[], object]) -> None:
    while True:
        ready, _, _ = select.select([descriptor, woken], [], [])
        if woken in ready:
            return
        hit = os.read(descriptor, 256)
        if not hit:  # hung up
            return
        if b"\n" in hit:
            action()

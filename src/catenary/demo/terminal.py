"""Reaction to the Enter key while a program runs."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def on_enter(action: Callable[[], object], *, source: int | None = None) -> Iterator[bool]:
    """Call `action()` in a thread whenever the user presses Enter during the block.

    Args:
        action: The function to call.
        source: File descriptor to read; None for standard input if it is a terminal.

    Yields:
        True if key presses are read; False if there is no terminal to read.
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
    """Return the descriptor of standard input; None if it is not a terminal."""
    return sys.stdin.fileno() if sys.stdin is not None and sys.stdin.isatty() else None


def _listen(descriptor: int, woken: int, action: Callable[[], object]) -> None:
    while True:
        ready, _, _ = select.select([descriptor, woken], [], [])
        if woken in ready:
            return
        hit = os.read(descriptor, 256)
        if not hit:  # end of file
            return
        if b"\n" in hit:
            action()

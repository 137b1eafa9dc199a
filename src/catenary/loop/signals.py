"""Ctrl-C, SIGTERM and SIGHUP while a loop is open: leaving is never cut short half-way.

Only in the main thread, where Python delivers signals. Outside of leaving, Ctrl-C does what it did
before. SIGTERM and SIGHUP (the terminal or the ssh connection is gone) raise SystemExit unless the
application handles them. All end in the loop's `__exit__`. While the loop is being left none
raises: each asks to hurry. A signal that is ignored stays ignored: `nohup` ignores SIGHUP.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import CodeType, FrameType
from typing import TypeAlias

from catenary.link import forget_in_child

Handler: TypeAlias = Callable[[int, FrameType | None], object] | int | None
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class SignalGuard:
    """Owns the handlers of SIGINT, SIGTERM and SIGHUP while a loop is open.

    `leaving`: the code objects of the functions that leave; a signal that finds one of them on the
    stack only sets `hurry`. (A flag set by those functions would leave a gap at their first line.)
    """

    def __init__(self, leaving: tuple[CodeType, ...]) -> None:
        self._leaving = leaving
        self._before: dict[signal.Signals, Handler] = {}
        self.hurry = False

    def install(self) -> None:
        """Take the signals over; a no-op outside the main thread, and where they are ours."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number in SIGNALS:
            before = signal.getsignal(number)
            # None: not from Python, so not ours to give back. SIG_IGN: ignored on purpose.
            if before is None or before is signal.SIG_IGN or before == self._handle:
                continue
            self._before[number] = before
            signal.signal(number, self._handle)
        forget_in_child(self)

    def restore(self) -> None:
        """Give the signals back. In another thread, where Python cannot do that, the handlers stay
        and do what was done before them."""
        if threading.current_thread() is not threading.main_thread():
            return
        while self._before:
            number, before = self._before.popitem()
            signal.signal(number, before)

    def forget(self) -> None:
        """Restore the signals in a forked child: they end it as if there were no loop."""
        self.restore()

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._is_leaving(frame):
            self.hurry = True
            return
        before = self._before.get(signal.Signals(number))
        if callable(before):
            before(number, frame)
        elif number == signal.SIGINT:
            raise KeyboardInterrupt
        else:
            raise SystemExit(128 + number)  # what a shell reports of a process ended by a signal

    def _is_leaving(self, frame: FrameType | None) -> bool:
        while frame is not None:
            if frame.f_code in self._leaving:
                return True
            frame = frame.f_back
        return False

"""Handling of Ctrl-C, SIGTERM and SIGHUP while a loop is open: leaving is never interrupted.

Handlers are only installed in the main thread, where Python delivers signals. While the loop is
not being left, Ctrl-C keeps its former effect. SIGTERM and SIGHUP (the terminal or the ssh
connection closed) raise SystemExit unless the application handles them. These exceptions reach the
loop's `__exit__`. While the loop is being left, a signal raises nothing and only shortens the
waits. A signal that is ignored remains ignored: `nohup` ignores SIGHUP.
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
    """Handlers of SIGINT, SIGTERM and SIGHUP while a loop is open.

    `leaving`: code objects of the functions that leave a loop. If one of them is on the stack, a
    signal only sets `hurry`. (A flag set by these functions would leave a gap at their first line.)
    """

    def __init__(self, leaving: tuple[CodeType, ...]) -> None:
        self._leaving = leaving
        self._before: dict[signal.Signals, Handler] = {}
        self.hurry = False

    def install(self) -> None:
        """Install the signal handlers; a no-op outside the main thread or if they are installed."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number in SIGNALS:
            before = signal.getsignal(number)
            # None: not set from Python, so it cannot be restored. SIG_IGN: ignored on purpose.
            if before is None or before is signal.SIG_IGN or before == self._handle:
                continue
            self._before[number] = before
            signal.signal(number, self._handle)
        forget_in_child(self)

    def restore(self) -> None:
        """Restore the former handlers.

        Python cannot do this in another thread. There, the handlers stay and call the former ones.
        """
        if threading.current_thread() is not threading.main_thread():
            return
        while self._before:
            number, before = self._before.popitem()
            signal.signal(number, before)

    def forget(self) -> None:
        """Restore the former handlers in a forked child, which has no loop."""
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
            raise SystemExit(128 + number)  # the exit status of a shell after a signal

    def _is_leaving(self, frame: FrameType | None) -> bool:
        while frame is not None:
            if frame.f_code in self._leaving:
                return True
            frame = frame.f_back
        return False

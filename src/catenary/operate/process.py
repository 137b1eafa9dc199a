"""Parent's side of `python -m catenary.operate`."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self

from catenary.errors import LoopError
from catenary.realtime.child import start_python

START_SECONDS = 120.0  # to scan and start a long segment
FOREVER = 1e9  # [s]
END_SECONDS = 15.0  # to stop the axes and close the segment


class OperateProcess:
    """Owner of a process that operates a target, and of a thread that reads its reports.

    Args:
        target: name of a target, or a machine file.
        share: name of the share that the process creates.
        show: receives each note and error as text, in the thread.
    """

    def __init__(self, target: str, share: str, show: Callable[[str], None]) -> None:
        self._show = show
        self._problem = f"the program for {target} is starting"
        self._target = target
        self._ending = False
        self._decided = threading.Event()  # set when cycles run, or the process has ended
        self._child = start_python(["-m", "catenary.operate", target, share])
        self._thread = threading.Thread(target=self._read, name="operate reports", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._child.pid

    def problem(self) -> str:
        """Return why there are no cycles: the start or the error of the process; "" otherwise."""
        return self._problem

    def wait_until_ready(self) -> None:
        """Wait until cycles run.

        Raises LoopError if the process has ended, or is not ready in time.
        """
        if not self._decided.wait(START_SECONDS) or self._problem:
            raise LoopError(self._problem)

    def end(self) -> None:
        """End the process in order: axes are stopped, the segment is closed."""
        self._ending = True
        self._child.process.terminate()
        self._thread.join(END_SECONDS)
        self._child.end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.end()

    def _read(self) -> None:
        failed = ""
        while (line := self._child.read_line(FOREVER)) is not None:
            kind, _, text = line.partition(" ")
            if kind == "ready":
                self._problem = ""
                self._decided.set()
            elif kind == "error":
                self._problem = failed = f"the program for {self._target} has ended: {text}"
            if text and (kind != "error" or self._decided.is_set()):
                self._show(f"{kind}: {text}")
        if not self._ending and not failed:
            status = self._child.process.wait()
            self._problem = f"the program for {self._target} has ended with status {status}"
            if self._decided.is_set():  # otherwise wait_until_ready raises it
                self._show(f"error: {self._problem}")
        self._decided.set()

"""The conversations beside a running cycle, and who steps them."""

from __future__ import annotations

import threading
from typing import TypeVar

from catenary.bus import LaneRunner
from catenary.core import Engine
from catenary.errors import LoopError
from catenary.procedure.exchange import Procedure

T = TypeVar("T")

BUSY_NS = 1_000_000  # between two steps, at most, while something is asked
IDLE = 0.010  # [s]; a new question waits at most so long for its first step


class Service:
    """Owns the lane of an engine and, in real time, the thread that steps it.

    In virtual time nobody else may run: the caller steps, between two cycles.
    """

    def __init__(self, engine: Engine) -> None:
        self.runner = LaneRunner(engine)
        self._engine = engine
        self._ended = threading.Event()
        self._asked = threading.Event()
        self._failure: Exception | None = None
        self._thread: threading.Thread | None = None
        if engine.scheduling != "virtual time":
            self._thread = threading.Thread(target=self._serve, name="catenary lane", daemon=True)

    def start(self) -> None:
        if self._thread is not None:
            self._thread.start()

    def converse(self, *procedures: Procedure[T]) -> list[T]:
        """Runs conversations beside the cycle, all at once, from the thread that iterates: it
        keeps cycling without an application until the last one is answered."""
        tasks = [self.runner.submit(procedure) for procedure in procedures]
        self._asked.set()
        while not all(task.done for task in tasks):
            self._engine.run(1)
            if self._thread is None:
                self.runner.step()
            elif not self._thread.is_alive():
                raise LoopError("the conversations beside the cycle have ended") from self._failure
        return [task.result() for task in tasks]

    def end(self) -> None:
        """Ends the thread; conversations left over get LoopError."""
        self._ended.set()
        self._asked.set()
        if self._thread is not None and self._thread.is_alive():
            self._thread.join()
        self.runner.close()

    def _serve(self) -> None:
        try:
            while not self._ended.is_set():
                self._asked.clear()
                self.runner.step()
                if self.runner.busy:
                    self._engine.lane_wait(BUSY_NS)
                else:
                    self._asked.wait(IDLE)
        except Exception as failure:  # told by the next conversation: a thread has no caller
            self._failure = failure
            self.runner.close()

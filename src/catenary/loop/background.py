"""Python thread that iterates an open loop while the program does other work.

Theory of operation. The thread commits the targets in every cycle under a lock. `update` takes the
same lock, so nothing is committed while a program writes its targets. The thread never waits for
the lock. The native core limits the time for which the targets of the last update are valid
(core/_setpoints.pyx). A program that blocks the interpreter therefore cannot keep an axis moving.
If the loop raises an error, the thread leaves the loop and ends. The next call of the program
raises the error. In virtual time, the thread also keeps pace with the wall clock.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from catenary.core import Iteration
from catenary.errors import LoopError
from catenary.loop.moves import Awaited, stopped_late
from catenary.loop.networks import VIRTUAL, NetworksIteration, leave_all
from catenary.loop.session import Session
from catenary.loop.signals import SignalGuard

END_TIMEOUT = 30.0  # [s] plus eight periods; leaving a loop after an error takes some seconds
LEAVE_TIMEOUT = 1.0  # [s] to wait for an update in progress when the loop is left
UPDATE_TIMEOUT = 5.0  # [s] to wait for an update of another thread
BEHIND = 0.1  # [s] virtual time does not make up for a larger lag
LOOK = 0.5  # [s] longest time between two checks of a waiting call


class Background:
    """Thread that iterates an open loop, and the lock under which targets are committed.

    `error`: the error that ended the loop; None if there is none.
    """

    def __init__(
        self,
        sessions: Sequence[Session],
        iteration: Iteration | NetworksIteration,
        guard: SignalGuard,
    ) -> None:
        self.error: Exception | None = None
        self._sessions = sessions
        self._iteration = iteration
        self._guard = guard
        self._commit = threading.Lock()
        self._updating = 0  # identifier of the thread inside `update`; 0: none
        self._cycled = threading.Condition()
        self._ended = threading.Event()
        self._was_raised = False  # True if a call has raised the error
        self._pace = _Pace(sessions[0])
        self._process = os.getpid()
        self._thread = threading.Thread(target=self._iterate, name="catenary loop", daemon=True)

    def start(self) -> None:
        """Run one step in the calling thread, then start the background thread.

        Raises:
            ValueError: The loop is inline and exchanges its frames in the thread of the program.
            LoopError: An axis is powered in CST, and this call commits no torque set-points.
            CatenaryError: The first step failed.
        """
        if self._sessions[0].plan.cycle.execution == "inline":
            raise ValueError(
                "run_in_background needs a threaded loop: other Python code would delay the frames "
                "of an inline loop"
            )
        for session in self._sessions:
            session.refuse_powered_torque("run_in_background")
        next(self._iteration)  # the first step commits nothing; it must precede any update
        for session in self._sessions:
            session.engine.background = True
            session.end_background = self.end
            session.update = self.update
        self._iteration.commit_lock = self._commit
        self._thread.start()

    def end(self) -> None:
        """Refuse further updates, end the thread and wait for it. A no-op in a forked child.

        If the thread itself calls this, it does not wait. It ends after the present step.

        Raises:
            LoopError: The thread does not end in time.
        """
        if self._process != os.getpid():
            return
        self._end_updates()
        if threading.current_thread() is self._thread or self._thread.ident is None:
            return
        self._thread.join(END_TIMEOUT + 8e-9 * self._sessions[0].plan.cycle.period_ns)
        if self._thread.is_alive():
            raise LoopError(
                "the thread that iterates the loop does not end",
                hint="check for a callback or a sink that does not return",
            )

    @property
    def is_alive(self) -> bool:
        """True while the thread iterates."""
        return self._thread.is_alive() and not self._ended.is_set()

    def raise_error(self) -> None:
        """Raise the error that ended the loop, if any, and mark it as raised."""
        if self.error is not None:
            self._was_raised = True
            raise self.error

    def unraised_error(self) -> Exception | None:
        """Return the error that ended the loop, and mark it as raised.

        Return None if there is no error, or if a call has already raised it.
        """
        error = None if self._was_raised else self.error
        self._was_raised = True
        return error

    @contextmanager
    def update(self) -> Iterator[None]:
        """Commit the writes of a block together: see `Loop.update`."""
        self._take_commit()
        try:
            self._require_alive()
            with self._written_targets():
                yield
                self._require_alive()  # otherwise the targets would appear to be sent
                self._iteration.step_movers()  # moving axes keep the targets of their moves
        finally:
            self._updating = 0
            self._commit.release()

    @contextmanager
    def _written_targets(self) -> Iterator[None]:
        """Commit the writes of the block. If the block raises, discard all of them."""
        engines = [session.engine for session in self._sessions]
        for engine in engines:
            engine.begin_update()
        before = [bytes(engine.blocks()[1]) for engine in engines]
        complete = False
        try:
            yield
            complete = True
        finally:
            for engine, targets in zip(engines, before, strict=True):
                if (
                    not complete and not self._ended.is_set()
                ):  # if ended: keep the targets of the stop
                    engine.blocks()[1][:] = targets
                engine.end_update(complete)

    def wait(self, move: Awaited, timeout: float | None) -> None:
        """Wait until a move is done: see `Loop.wait`."""
        self._refuse_inside_update("wait")
        if threading.current_thread() is self._thread:
            raise RuntimeError(
                "loop.wait() was called in the thread that iterates the loop: it would deadlock"
            )
        limit = move.patience if timeout is None else timeout
        end = time.monotonic() + limit
        with self._cycled:
            while not move.done:
                self._require_alive()
                if time.monotonic() > end:
                    raise stopped_late(move, limit)
                self._cycled.wait(LOOK)
            if move.error is not None and self._thread.is_alive():
                self._cycled.wait(LOOK)  # if the loop is ending, prefer the original error
        if move.error is not None:
            self.raise_error()
            raise move.error

    def _take_commit(self) -> None:
        self._refuse_inside_update("update")
        self._require_alive()
        if not self._commit.acquire(timeout=UPDATE_TIMEOUT):
            raise LoopError(
                f"another thread has been inside loop.update() for more than {UPDATE_TIMEOUT:g} s",
                hint="compute and wait before `with loop.update():`; inside it, only write targets",
            )
        self._updating = threading.get_ident()

    def _refuse_inside_update(self, call: str) -> None:
        if self._updating == threading.get_ident():
            raise RuntimeError(
                f"loop.{call}() was called inside `with loop.update():`, which commits at its end: "
                "leave the block first"
            )

    def _require_alive(self) -> None:
        self.raise_error()
        self._sessions[0].require_open()
        if self._ended.is_set():
            raise RuntimeError("the loop is closed, or is closing")

    def _end_updates(self) -> None:
        """Refuse further updates, and wait at most a second for one in progress.

        A later write must not replace the targets of the final stop.
        """
        self._ended.set()
        if self._updating != threading.get_ident() and self._commit.acquire(timeout=LEAVE_TIMEOUT):
            self._commit.release()

    def _iterate(self) -> None:
        for session in self._sessions:
            session.service.runner.adopt()
        try:
            while not self._ended.is_set():
                next(self._iteration)
                self._report_cycle()
                self._pace.keep(self._ended)
        except Exception as error:  # a thread has no caller: the next call raises it
            self._fail(error)
        except BaseException as end:  # SystemExit: the axes must not continue without the thread
            self._fail(LoopError(f"the thread that iterates the loop was ended by {end!r}"))
        finally:
            self._ended.set()
            self._report_cycle()

    def _report_cycle(self) -> None:
        with self._cycled:
            self._cycled.notify_all()

    def _fail(self, error: Exception) -> None:
        """Leave the loop like the end of a `with` block."""
        for session in self._sessions:
            session.report_end(error)
        self.error = error
        for problem in leave_all(self._sessions, self._guard):
            error.add_note(f"while leaving: {problem}")


def program_ends() -> bool:
    """Return True while `atexit` functions run: Python has marked its main thread as ended."""
    return not threading.main_thread().is_alive()


class _Pace:
    """Limiter that keeps virtual time from overtaking the wall clock."""

    def __init__(self, session: Session) -> None:
        self._engine = session.engine
        self._is_virtual = session.engine.scheduling == VIRTUAL
        self._offset: float | None = None  # [s] virtual time minus wall clock at the start

    def keep(self, ended: threading.Event) -> None:
        """Wait until the wall clock reaches virtual time; a no-op in real time."""
        if not self._is_virtual:
            return
        offset = self._engine.now() * 1e-9 - time.monotonic()
        if self._offset is None or offset < self._offset - BEHIND:
            self._offset = offset
        if offset > self._offset:
            ended.wait(offset - self._offset)

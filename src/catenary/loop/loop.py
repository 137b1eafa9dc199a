"""Loop: it plans the requests, brings the devices to OP, and runs the cycle.

Entering enables the drives, and axes in a position mode hold. If entering fails, the loop stops the
drives, brings the devices out of OP, and raises the error. Leaving also stops the drives, in
compiled code, before the devices leave OP.
"""

from __future__ import annotations

import math
import os
import threading
import warnings
import weakref
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from types import TracebackType

from catenary.bus import SubDevice
from catenary.core import Cycle, Iteration
from catenary.errors import LawError
from catenary.log import Log
from catenary.loop.background import Background, program_ends
from catenary.loop.capture_options import CaptureOptions, capture_options
from catenary.loop.clocks import Clocks
from catenary.loop.devices import LoopRequest
from catenary.loop.laws.law import Law, LawFunction, Laws
from catenary.loop.laws.law import law as made_law
from catenary.loop.laws.run import LawRun, Numbers
from catenary.loop.moves import Awaited, require_move, wait_for_move
from catenary.loop.network import TROUBLE, Network, Settings, leave_method
from catenary.loop.networks import (
    NetworksIteration,
    chosen_network,
    leave_all,
    make_networks,
    share_time,
)
from catenary.loop.options import ClockOptions, Scheduling, StopPolicy
from catenary.loop.session import Session
from catenary.loop.signals import SignalGuard
from catenary.loop.stream import Stream
from catenary.loop.timing import Timing
from catenary.loop.watches.external_clock import ExternalClockWatch
from catenary.plan.cycle import ExecutionMode
from catenary.plan.planner import Plan
from catenary.plan.sink import Sink
from catenary.plan.trigger import Trigger
from catenary.wire.al import AlState

LEAVE_TIMEOUT = 60.0  # [s] to wait for another thread that leaves the loop


class Loop:
    """Cyclic exchange with the devices of its requests: a context manager and an iterator.

        with cat.Loop(arm, period=1e-3) as loop:
            for cycle in loop:
                ...

    Requests on several MainDevices run as several networks in one schedule
    (docs/how_to/networks.md). Such a loop is threaded, with a thread for each network.
    `cycle.networks[i]` and `loop.networks[i]` belong to one network. The properties of the loop
    itself are those of the first network.

    Args:
        requests: `Drives`, `Inputs`, `Outputs` and other process-data requests.
        period: Period of the cycle [s].
        execution: "threaded": a native thread exchanges the frames, and Python follows. "inline":
            the iterating thread exchanges the frames itself.
        enable: True to enable the drives on entry.
        watchdog: Watchdog time of the devices' outputs [s]. 0 disables the watchdog. None: 0.1 s;
            for devices in CST, the longer of 10 ms and five exchanges.
        cpu: CPU of the native thread, or one CPU for each network. None: any CPU of the process;
            for several networks the last CPUs, if there are more CPUs than networks.
        priority: SCHED_FIFO priority of the native thread; None: that of the process.
        log: Number of cycles in the log and in the log of an error.
        laws: Laws to compile on entry, before OP; with several networks for each of them, or one
            list of laws for each network. Other laws are compiled when they are started.
        sink: Receiver of every cycle, for example a `Share` for other processes, or one for each
            network.
        stop: Conditions that stop axes or end the loop.
        scheduling: Options for sleeping and for receiving frames: see `Scheduling`.
        clocks: Synchronisation of the distributed clocks.
        trigger: `TriggerSender` or `TriggerReceiver` of `cat.share`: start the cycles of loops in
            other processes with those of this loop, or the reverse (docs/how_to/networks.md).
        log_axes: True to also log the values of every axis (docs/how_to/recording.md).
        capture: Folder for pcapng files with the frames around an error or a stopped axis, or
            `CaptureOptions` (docs/how_to/capture.md). None: no files.
        diagnosis: Time between two readings of each device's diagnosis messages and
            synchronisation counters [s]; new ones become events (docs/how_to/diagnosis.md). None:
            never.

    Raises:
        ValueError: An option is impossible, or a request names devices of several MainDevices.
        TypeError: A request, a law or a group of options has the wrong type.
        LawError: A law has an argument with an unknown name.
    """

    _iteration: Iteration | NetworksIteration | None
    _background: Background | None
    _finalizer: weakref.finalize[..., Loop] | None

    def __init__(
        self,
        *requests: LoopRequest,
        period: float = 1e-3,
        execution: ExecutionMode = "threaded",
        enable: bool = True,
        watchdog: float | None = None,
        cpu: int | Sequence[int] | None = None,
        priority: int | None = 80,
        log: int = 1000,
        laws: Laws = (),
        sink: Sink | Sequence[Sink] | None = None,
        stop: StopPolicy = StopPolicy(),
        scheduling: Scheduling = Scheduling(),
        clocks: ClockOptions = ClockOptions(),
        trigger: Trigger | None = None,
        log_axes: bool = False,
        capture: CaptureOptions | str | os.PathLike[str] | None = None,
        diagnosis: float | None = None,
    ) -> None:
        settings = Settings(
            period=period,
            execution=execution,
            watchdog=watchdog,
            priority=priority,
            log=log,
            log_axes=log_axes,
            stop=stop,
            scheduling=scheduling,
            clocks=clocks,
            trigger=trigger,
            capture=capture_options(capture),
            diagnosis=diagnosis,
        )
        self._networks = make_networks(requests, settings, cpu, sink, laws)
        self._quorum = checked_quorum(scheduling.quorum, len(self._networks))
        self._enable, self._guard = enable, make_guard()
        self._leaving = threading.RLock()
        self._iteration = self._background = self._finalizer = None

    def __enter__(self) -> Loop:
        if any(session.is_open for session in self._sessions):
            raise RuntimeError(
                "the loop is already open: use either `with` or open(), and only once"
            )
        for network in self._networks:
            network.main.require_no_loop()
        try:
            self._guard.install()
            self._iteration = self._background = None
            for network in self._networks:
                network.current_session = None
            abandon = leave_method(self._abandon)
            sessions = [network.prepare(abandon) for network in self._networks]
            self._leave_at_exit(sessions)
            if len(sessions) > 1:
                share_time(sessions)
            for session in sessions:
                session.open(sessions[0].engine.origin)
            if self._enable:
                for session in sessions:
                    session.enable()
            for session in sessions:
                session.reset_figures()
            return self  # inside `try`: a signal may also arrive at this line
        except BaseException as error:
            self._report_end(error)
            for problem in self._leave():
                error.add_note(f"while leaving: {problem}")
            raise

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is not None:
            self._report_end(error)
        problems = self._leave()
        if (
            self._background is not None
            and (unraised := self._background.unraised_error()) is not None
        ):
            problems.insert(0, unraised)
        if error is not None:
            for problem in problems:
                error.add_note(f"while leaving: {problem}")
        elif problems:
            raise problems[0]

    def open(self) -> Loop:
        """Enter the loop without a `with` block, for a notebook or a server; return the loop.

        `close` leaves the loop. The end of the program and `close` of the MainDevice also leave it.
        """
        return self.__enter__()

    def close(self) -> None:
        """Leave the loop: stop the axes, then the cycle, and bring the devices to PRE-OP.

        Raises the error that ended the loop in the background, unless another call has raised it.
        Otherwise, raises the first problem while leaving. A second call has no effect.
        """
        if not self._sessions:
            return
        if any(session.is_open for session in self._sessions):
            self._guard.install()  # again: a notebook sets its own handlers in each cell
        self.__exit__(None, None, None)

    def run_in_background(self) -> None:
        """Let a Python thread iterate the loop from now on, and return at once.

        The thread commits the targets in every cycle: write them in `with loop.update():`. An error
        of the loop stops the axes and closes the loop. The next `update`, `wait` or `close` raises
        it. An interrupt of the program (Ctrl-C) does not stop the loop. `close` and the end of the
        program stop it. In virtual time, the thread keeps pace with the wall clock. No effect if
        the loop already runs in the background.

        Raises:
            ValueError: The loop is inline.
            LoopError: An axis is powered in CST.
            RuntimeError: The loop is not open.
        """
        if self._background is not None:
            self._background.raise_error()
            if self._background.is_alive:
                return
        iteration = self._iterating()
        self._background = Background(self._sessions, iteration, self._guard)
        try:
            self._background.start()
        except BaseException:
            if not self._background.is_alive:
                self._background = None
            raise

    def update(self) -> AbstractContextManager[None]:
        """Return a context in which a program writes one consistent set of targets and requests.

        While the loop runs in the background, the whole set is committed when the block ends. If
        the block raises, nothing is committed. In CSV, PV and CST, the set is valid for
        `StopPolicy.command_timeout`. After it, CSV and PV decelerate and CST is stopped.

        Raises:
            RuntimeError: The loop does not run in the background (`next(loop)` commits) or is
                closed, or the call is inside another `update` block.
            LoopError: Another thread has been inside its block for more than 5 s.
            CatenaryError: The error that ended the loop in the background.
        """
        if self._background is None:
            raise RuntimeError(
                "update() needs run_in_background(); a program that iterates the loop itself "
                "commits its targets with `next(loop)`"
            )
        return self._background.update()

    @property
    def error(self) -> Exception | None:
        """Error that ended the loop in the background; None if there is none."""
        return None if self._background is None else self._background.error

    def __iter__(self) -> Iterator[Cycle]:
        """Return the iterator; a second iteration continues where the last one ended."""
        return self._iterating()

    def _iterating(self) -> Iteration | NetworksIteration:
        self._require_foreground()
        if self._iteration is None:
            self._iteration = self._make_iteration()
            for session in self._sessions:
                session.service.runner.adopt()
        return self._iteration

    def __next__(self) -> Cycle:
        return next(iter(self))

    def wait(self, move: Awaited, timeout: float | None = None) -> None:
        """Iterate until a move or a touch probe is done: `loop.wait(arm.move_to(0.5))`.

        The call returns when the axes have reached their targets, or are at rest after
        `move.stop()`. While the loop runs in the background, the call only waits, and any thread
        may use it.

        Args:
            move: Result of `arm.move_to`, `arm.move_by`, `arm.home` or `arm.probe`.
            timeout: Time after which the move is stopped [s]. None: twice the expected duration
                plus 10 s; for homing and touch probes 60 s.

        Raises:
            MoveError: The move took too long or was replaced, or its axis was stopped.
            DriveError: A drive is in fault or was stopped. The iteration may raise other errors.
            TypeError: `move` is neither a move nor a touch probe.
            RuntimeError: The loop is not open, or the call is inside `with loop.update():`.
        """
        require_move(move)
        if self._background is None:
            wait_for_move(iter(self), move, timeout)
        else:
            self._background.wait(move, timeout)

    def run_for(self, seconds: float) -> None:
        """Run cycles for a time. The axes hold, or continue their moves.

        Args:
            seconds: The time [s].

        Raises:
            ValueError: The time is not positive and finite.
            RuntimeError: The loop is not open, or a background thread iterates it.
            CatenaryError: The iteration fails, for example with WorkingCounterError.
        """
        if not 0 < seconds < math.inf:
            raise ValueError(f"seconds={seconds}: must be positive and finite")
        start: float | None = None
        for cycle in self:
            start = cycle.time if start is None else start
            if cycle.time - start >= seconds:
                return

    def _make_iteration(self) -> Iteration | NetworksIteration:
        first = self._opened
        if len(self._networks) > 1:
            return NetworksIteration(self._networks, self._quorum)
        return Iteration(
            first.engine,
            first.judge,
            trouble=TROUBLE,
            al_status=AlState.OP,
            beside=first.service.beside,
            movers=first.views.movers,
        )

    def start(
        self,
        law: Law | LawFunction,
        memory: Sequence[float] | Numbers = (),
        parameters: Sequence[float] | Numbers = (),
        *,
        budget: float | None = None,
        overruns: int = 3,
        network: int | None = None,
    ) -> LawRun:
        """Start a compiled law. From the next cycle on, it computes the set-points.

        It runs in the cycle thread. You can iterate the loop at the same time, to monitor it. Each
        network runs one law at a time. Your program sets the targets of the other networks.

        Args:
            law: Function or `Law`. It starts from the commanded set-points.
            memory: Initial state, float64, at most 4096 numbers.
            parameters: Values from the application, float64, at most 4096 numbers.
            budget: Longest time of one step [s]; None: 0.4 periods; 0: no check. The frames need
                the remainder of the period.
            overruns: Number of consecutive steps over the budget that end the law.
            network: Number of the network, in the order of `networks`. Required if there are
                several.

        Returns:
            Handle of the running law.

        Raises:
            LawError: The law cannot be compiled, or does not return. The iteration raises it for an
                exception, a NaN or infinite target, overruns, and a step that does not return.
            ValueError: An argument is impossible, or the budget leaves too little of the period for
                the frames.
            RuntimeError: The loop is not open, an axis of the network is in a move, or a touch
                probe is in use.
        """
        laws = self._network("a law", network).session.laws
        return laws.start(made_law(law), memory, parameters, budget, overruns)

    def run(
        self,
        law: Law | LawFunction,
        memory: Sequence[float] | Numbers = (),
        parameters: Sequence[float] | Numbers = (),
        *,
        budget: float | None = None,
        overruns: int = 3,
        compiled: bool = True,
        network: int | None = None,
    ) -> Numbers:
        """Run a law to its end and return its memory. After it, the axes hold.

        Networks without a law hold during this time. Laws of other networks continue.

        Args:
            law: Function or `Law`: see `start`.
            memory: Initial state: see `start`.
            parameters: Values from the application: see `start`.
            budget: Longest time of one step [s]: see `start`.
            overruns: Number of consecutive steps over the budget: see `start`.
            compiled: False: run it as Python, in the thread of the caller. This is slow, but shows
                Python's errors. Use it to find mistakes. `budget` and `overruns` are then ignored.
            network: Number of the network: see `start`.

        Returns:
            Memory of the law after its last step.

        Raises:
            LawError: The law cannot be compiled, or failed: see `start`.
            ValueError: An argument is impossible.
            RuntimeError: The loop is not open, an axis of the network is in a move, a touch probe
                is in use, or a background thread iterates the loop.
        """
        self._require_foreground()
        one = self._network("a law", network)
        if not compiled:
            return self._run_as_python(one, made_law(law), memory, parameters)
        run = one.session.laws.start(made_law(law), memory, parameters, budget, overruns)
        if len(self._networks) > 1:
            one.session.laws.run(run, lambda: self._hold_beside(one))
        else:
            one.session.laws.run(run, one.advance_law)
        return run.memory

    def _hold_beside(self, led: Network) -> None:
        """Run one cycle of all networks in which only laws set targets."""
        iteration = self._iterating()
        assert isinstance(iteration, NetworksIteration)
        iteration.hold(led.session)

    def _run_as_python(
        self,
        network: Network,
        law: Law,
        memory: Sequence[float] | Numbers,
        parameters: Sequence[float] | Numbers,
    ) -> Numbers:
        step, kept = network.session.laws.python_step(law, memory, parameters)
        start: float | None = None
        for cycle in self:
            start = cycle.time if start is None else start
            if cycle.networks[network.number].refused:
                raise LawError(f"law {law} left NaN or infinity in a target")
            if step(cycle.time - start):
                break
        return kept

    def stream(self, capacity: int = 1000, *, network: int | None = None) -> Stream:
        """Return a `Stream`, which a slower thread can fill with set-points in advance.

        Args:
            capacity: Number of rows that the stream can hold. One row is for one cycle.
            network: Number of the network, in the order of `networks`. Required if there are
                several.

        Raises:
            ValueError: An argument is out of range, or `network` is missing.
            RuntimeError: The loop is not open, an axis of the network is in a move, or a touch
                probe is in use.
        """
        return self._network("a stream", network).stream(capacity)

    def restore(self, sub: SubDevice) -> None:
        """Allow a held device (event DeviceHeld or DeviceReplaced) to go to OP.

        The call returns at once: see `sub.state` and the events.

        Raises:
            ValueError: The device belongs to another MainDevice, or to the kernel master.
        """
        for session in self._sessions:
            if session.main is sub.main:
                return session.watch.release(sub)
        raise ValueError(f"{sub.station} is not in this loop: it belongs to another MainDevice")

    @property
    def networks(self) -> tuple[Network, ...]:
        """Networks of the loop, one per MainDevice, each with its plan, timing, clocks and log."""
        return self._networks

    @property
    def plan(self) -> Plan:
        """Plan of the first network; `print` shows it as text."""
        return self._networks[0].plan

    @property
    def timing(self) -> Timing:
        """Timing of the cycles since the loop was opened; also available when it is closed."""
        return self._networks[0].timing

    @property
    def clocks(self) -> Clocks:
        """Distributed clocks of the first network; `print` shows them as a table.

        Raises:
            RuntimeError: No request has `dc=`.
        """
        return self._networks[0].clocks

    @property
    def external(self) -> ExternalClockWatch:
        """External clock that the cycle starts follow; `print` shows its state.

        Raises:
            RuntimeError: The loop has no external clock.
        """
        return self._networks[0].external

    @property
    def scheduling(self) -> str:
        """Scheduling and locked memory that the cycle thread obtained, as text."""
        return self._networks[0].scheduling

    @property
    def log(self) -> Log:
        """The last cycles (1000, or `log`), oldest first; see `Log`."""
        return self._networks[0].log

    def histogram(self, phase: str) -> list[tuple[float, float, int]]:
        """Return (lower [s], upper [s], count) of every non-empty bucket of a phase of `timing`."""
        return self._networks[0].histogram(phase)

    def wait_locked(self, within: float = 1e-6, timeout: float = 5.0) -> None:
        """Run cycles until the clocks are locked. The axes hold.

        They are locked when every clock differs by at most `within` from the reference clock and
        the cycle starts are in phase with it. The bound remains in force: a `ClockUnlocked` event
        reports that it is exceeded, a `ClockLocked` event that it holds again. Several networks are
        checked one after the other.

        Args:
            within: Bound of the differences and of the phase [s].
            timeout: Longest wait for each network [s].

        Raises:
            ClockError: The clocks are not locked after `timeout`.
            LoopError: An axis is powered in CST. Its torque would become stale during the wait.
            RuntimeError: No request has `dc=`, the loop is not open, or a background thread
                iterates it.
            ValueError: `within` is not positive.
        """
        self._require_foreground()
        with_clocks = [
            n for n in self._networks if n.current_session and n.current_session.clocks is not None
        ]
        if not with_clocks:
            raise RuntimeError(
                "no distributed clocks in this loop: request them with Drives(..., dc=True)"
            )
        for session in self._sessions:
            session.refuse_powered_torque("wait_locked")
        for network in with_clocks:
            network.wait_locked(within, timeout)

    def _require_foreground(self) -> None:
        """Raise RuntimeError if a background thread iterates the loop, or if it is closed."""
        if self._background is not None and self._background.is_alive:
            raise RuntimeError(
                "the loop runs in the background, where a thread iterates it; write targets in "
                "`with loop.update():`, wait with loop.wait(move), start laws with loop.start()"
            )
        self._opened.require_open()

    def _network(self, what: str, number: int | None) -> Network:
        """Return the network in which a law or a stream may start.

        Args:
            what: Text for the errors: "a law", "a stream".
            number: Number of the network; None: the only one.

        Raises:
            ValueError: There is no such network, or there are several and `number` is None.
            RuntimeError: The loop has never been entered, an axis is in a move, or a touch
                probe is in use.
        """
        network = chosen_network(self._networks, what, number)
        if network.session.views.movers:
            raise RuntimeError(
                f"{what} cannot start during a move or while a touch probe is in use: first call "
                "loop.wait() with the move or the probe, or its stop() and then loop.wait()"
            )
        return network

    @property
    def _sessions(self) -> list[Session]:
        """Sessions of the networks that are prepared."""
        return [
            network.current_session
            for network in self._networks
            if network.current_session is not None
        ]

    @property
    def _opened(self) -> Session:
        return self._networks[0].session

    def _abandon(self) -> None:
        """Leave the loop because the MainDevice is being closed."""
        for problem in self._leave():
            warnings.warn(f"while leaving the open loop: {problem}", RuntimeWarning, stacklevel=2)

    def _leave_at_exit(self, sessions: Sequence[Session]) -> None:
        """Ensure that an open loop is left when it is deleted, or when the program ends."""
        self._finalizer = weakref.finalize(self, leave_open_loop, sessions, self._guard)

    def _report_end(self, error: BaseException) -> None:
        """Report the error that ends the loop to the sinks and captures."""
        for network in self._networks:
            network.report_end(error)

    def _leave(self) -> list[Exception]:
        """Stop every network, regardless of errors in the others; return the problems.

        Then restore the signal handlers. If another thread is already leaving the loop, the call
        first waits for it, at most `LEAVE_TIMEOUT`.
        """
        is_ours = self._leaving.acquire(timeout=LEAVE_TIMEOUT)
        try:
            problems = leave_all(self._sessions, self._guard)
            for network in self._networks:
                problems += network.take_down()
        finally:
            self._guard.restore()
            if self._finalizer is not None:
                self._finalizer.detach()
            if is_ours:
                self._leaving.release()
        return problems


def make_guard() -> SignalGuard:
    """Return signal handlers that let the functions that leave a loop complete."""
    leaving = (Loop.close, Loop.__exit__, Loop._leave, leave_open_loop)
    return SignalGuard(tuple(each.__code__ for each in leaving))


def checked_quorum(quorum: int | None, count: int) -> int:
    """Return the number of networks that must be good.

    Args:
        quorum: Requested number; None: all.
        count: Number of networks.

    Raises:
        ValueError: The quorum is not from 1 to the number of networks.
    """
    if quorum is not None and not 1 <= quorum <= count:
        raise ValueError(f"quorum={quorum}: must be 1 to the number of networks, {count}")
    return count if quorum is None else quorum


def leave_open_loop(sessions: Sequence[Session], guard: SignalGuard) -> None:
    """Leave a loop that was deleted, or that is open at the end of the program, and warn.

    There is no warning at the end of the program if the loop runs in the background and can be
    left without problems. The warning comes last, because it may be turned into an error.

    Args:
        sessions: Sessions of the loop.
        guard: Signal handlers of the loop.
    """
    if not any(session.is_open for session in sessions):
        return
    for session in sessions:
        if session.is_open:
            session.stop_axes_at_once()
    problems = leave_all(sessions, guard)
    guard.restore()
    if program_ends() and not problems and all(one.in_background for one in sessions):
        return
    text = "a Loop was not left: its axes have been stopped. Use it in a with block, or close() it"
    text += "".join(f"; {problem}" for problem in problems)
    warnings.warn(text, RuntimeWarning, stacklevel=2)

"""Loop: wishes become a plan, the plan a cycle that runs, the cycle `for cycle in loop`.

Entering ends with the drives enabled and holding, or with everything safe and a specific error.
Leaving, for whatever reason, stops the drives natively before the states go down.
"""

from __future__ import annotations

import math
import threading
import warnings
import weakref
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from types import TracebackType
from typing import Any, Literal, Self

from catenary.bus import SubDevice
from catenary.core import (
    CYCLE_CLOCKS,
    CYCLE_DROPPED,
    CYCLE_LAW_FAILED,
    CYCLE_NONE,
    CYCLE_STOPPED,
    CYCLE_WORKING_COUNTER,
    Cycle,
    Iteration,
)
from catenary.errors import LawError
from catenary.loop.axis_watch import StopPolicy
from catenary.loop.background import Awaited, Background
from catenary.loop.carried import CarriedRunning, carried
from catenary.loop.clocks import Clocks
from catenary.loop.devices import DeviceWish, by_network, main_device_of
from catenary.loop.laws.law import Law
from catenary.loop.laws.law import law as made_law
from catenary.loop.laws.run import LawRun, Numbers
from catenary.loop.publishing import one_sink_each
from catenary.loop.running import LogArray, Running, take_down
from catenary.loop.signals import SignalGuard
from catenary.loop.stream import Stream
from catenary.loop.timing import Timing
from catenary.loop.watch import Policy
from catenary.plan.clocks import BURST
from catenary.plan.cycle import FollowedClock, ReceiveMode
from catenary.plan.make import Plan, make_plan, period_in_ns
from catenary.plan.sink import Sink
from catenary.wire.al import State

ENDING = CYCLE_WORKING_COUNTER | CYCLE_DROPPED | CYCLE_STOPPED | CYCLE_NONE | CYCLE_LAW_FAILED
TROUBLE = ENDING | CYCLE_CLOCKS
LATE_LIMIT_POSITION = 0.050  # [s], CSP
LATE_LIMIT_VELOCITY = 0.050  # [s], CSV
LATE_LIMIT_TORQUE = 0.010  # [s], CST
HANDOVER = 0.020  # [s], CST
LOG_LIMIT = 2**24  # cycles: a gigabyte


class Loop:
    """Owns the cyclic exchange of the devices its wishes name, as a context manager and an iterator
    of one `Cycle`.

    `period` [s]. `run`: "threaded", a native thread keeps the instants and Python follows; or
    "inline", the thread that iterates exchanges the frames itself. `receive`: "look", "wait" or
    "spin"; None: "wait" when threaded, "look" when inline. `enable`: drives are enabled on entry.
    `late_limit` [s] without fresh set-points, then quick stop; None: 50 ms in CSP and CSV, 10 ms in
    CST; 0: never, refused for axes that use CST. `handover` [s]: CST keeps its torque for this time
    after a law or stream ended, then quick stop. `on_axis_stopped`: the core stopped a required
    axis without a request: "raise", the iteration raises DriveError; "event", see the event
    `AxisStopped` and `Drives.stopped`. `lost_limit`: cycles in a row without all answers before
    WorkingCounterError. `stop_deadline` [s] for standing still when leaving. `watchdog` [s] of the
    devices' outputs; 0: off; None: 0.1 s, in CST the longer of 10 ms and five exchanges.
    `busy_wait` [s] before each cycle start instead of a plain sleep; it costs as much processor
    time. `switch_interval` [s] of the interpreter while an inline loop is open in real time; None:
    as it is (see `interpreter` in `loop.timing`). `collect_deadline`: threaded, the share of the
    period in which frames may come back; a law's budget shortens it.
    `log`: how many cycles the log, and that of an error, reaches back. `raise_faults`: a drive in
    fault, or one that left OPERATION_ENABLED by itself (STO), raises DriveError; else see
    `Drives.faults` and `Drives.stopped`. `on_return`: what becomes of a device that no
    wish requires and that comes back: "restore", its start-up list is replayed and it goes to OP;
    or "hold", it stays in PRE-OP until `restore`. `on_replacement`: the same for another device of
    the same product in its place, which is not even led to PRE-OP when held. `laws` are compiled
    on entry, before the devices go to OP; others when they are started. `sink` is given every
    cycle (a `cat.Share`: to other processes).

    Where a wish has `dc=`: `clock`, whom time is taken from: "reference", the wake-up follows the
    reference clock; "main", it follows the MainDevice's. `reference`: the device with that clock;
    None: the first that has one. `margin` [s]: from the instant to the frames, at most; None: 20 %
    of the period when threaded and for laws, 50 % when inline. `burst`: frames that bring the
    clocks together before the cycle begins.

    `exact_matching`: every cyclic frame carries the cycle number in a NOP datagram. A frame that a
    loop in the wiring or a second sender repeats is then never accepted as a current one. Costs 16
    bytes and 1.3 us of wire time per frame; `print(loop.plan)` shows it.

    `cpu` and `priority` (SCHED_FIFO) of the native thread; None: as they are. With wishes on
    several MainDevices (docs/networks.md) `cpu` is a sequence, one for each network, and `quorum`
    says how many of them must be good for a cycle to be; None: all.
    """

    def __new__(cls, *wishes: DeviceWish, **options: Any) -> Loop:
        """Wishes on several MainDevices make a `NetworksLoop`."""
        if cls is Loop and len(by_network(wishes)) > 1:
            from catenary.loop.networks import NetworksLoop

            return super().__new__(NetworksLoop)
        return super().__new__(cls)

    def __init__(
        self,
        *wishes: DeviceWish,
        period: float = 1e-3,
        run: Literal["threaded", "inline"] = "threaded",
        receive: ReceiveMode | None = None,
        enable: bool = True,
        late_limit: float | None = None,
        handover: float = HANDOVER,
        on_axis_stopped: StopPolicy = "raise",
        lost_limit: int = 3,
        stop_deadline: float = 2.0,
        watchdog: float | None = None,
        busy_wait: float = 0.0,
        switch_interval: float | None = None,
        collect_deadline: float = 0.8,
        log: int = 1000,
        raise_faults: bool = True,
        on_return: Policy = "restore",
        on_replacement: Policy = "hold",
        laws: Sequence[Law | Callable[..., Any]] = (),
        sink: Sink | Sequence[Sink] | None = None,
        clock: Literal["reference", "main"] = "reference",
        reference: SubDevice | None = None,
        margin: float | None = None,
        burst: int = BURST,
        exact_matching: bool = False,
        cpu: int | Sequence[int] | None = None,
        quorum: int | None = None,
        priority: int | None = 80,
    ) -> None:
        if run not in ("threaded", "inline"):
            raise ValueError(f'run={run!r}: "threaded" or "inline"')
        if clock not in ("reference", "main"):
            raise ValueError(f'clock={clock!r}: "reference" or "main"')
        period_in_ns(period)
        if not 0 <= busy_wait < period:
            raise ValueError(f"busy_wait={busy_wait} s: must be less than the period of {period} s")
        if switch_interval is not None and not 1e-6 <= switch_interval <= 1.0:
            raise ValueError(f"switch_interval={switch_interval} s: must be 1 us to 1 s")
        if not 0 < collect_deadline <= 1:
            raise ValueError(f"collect_deadline={collect_deadline}: a share of the period, 0 to 1")
        self._wishes = wishes
        self._main = main_device_of(wishes)
        self._period = period
        self._run: Literal["threaded", "inline"] = run
        self._receive: ReceiveMode = receive or ("look" if run == "inline" else "wait")
        self._enable = enable
        if late_limit is not None and not 0 <= late_limit < math.inf:
            raise ValueError(f"late_limit={late_limit} s: must be 0 (never) or a positive time")
        self._late_limit = late_limit
        self._handover = handover
        if on_axis_stopped not in ("raise", "event"):
            raise ValueError(f'on_axis_stopped={on_axis_stopped!r}: "raise" or "event"')
        self._on_axis_stopped: StopPolicy = on_axis_stopped
        self._lost_limit = lost_limit
        self._stop_deadline = stop_deadline
        self._watchdog = watchdog
        self._busy_wait = busy_wait
        self._switch_interval = switch_interval
        self._collect_deadline = collect_deadline
        if not 1 <= log <= LOG_LIMIT:
            raise ValueError(f"log={log} cycles: must be 1 to {LOG_LIMIT}")
        self._log = log
        self._raise_faults = raise_faults
        for name, policy in (("on_return", on_return), ("on_replacement", on_replacement)):
            if policy not in ("restore", "hold"):
                raise ValueError(f'{name}={policy!r}: "restore" or "hold"')
        self._on_return: Policy = on_return
        self._on_replacement: Policy = on_replacement
        self._laws = [made_law(law) for law in laws]
        [self._sink] = one_sink_each(sink, 1)
        self._clock: FollowedClock = clock
        self._reference = reference
        self._margin = margin
        self._burst = burst
        self._exact_matching = exact_matching
        if quorum not in (None, 1):
            raise ValueError(f"quorum={quorum}: there is one network")
        if cpu is not None and not isinstance(cpu, int):
            raise ValueError(f"cpu={cpu}: one network has one thread, on one CPU")
        self._cpu = cpu
        self._priority = priority
        leaving = (Loop.close, Loop.__exit__, Loop._leave, leave_open_loop)
        self._guard = SignalGuard(tuple(each.__code__ for each in leaving))
        self._running: Running | None = None
        self._iteration: Iteration | None = None
        self._background: Background | None = None
        self._finalizer: weakref.finalize[..., Loop] | None = None

    def __enter__(self) -> Loop:
        if self._running is not None and self._running.is_open:
            raise RuntimeError("the loop is open: `with` and open() open it; use one of them, once")
        try:
            self._guard.install()
            self._running = self._iteration = self._background = None
            self._running = self._prepared(self._abandoned())
            self._leave_at_the_latest([self._running])
            self._running.open()
            if self._enable:
                self._running.enable()
            self._running.engine.reset_histograms()
            if self._running.clocks is not None:
                self._running.clocks.reset()
            return self  # inside: a signal may come at this line too
        except BaseException as error:
            self._tell_end(error)
            for problem in self._leave():
                error.add_note(f"on the way down: {problem}")
            raise

    def _prepared(self, abandon: Callable[[], object]) -> Running:
        """All devices in SAFE-OP, all laws compiled."""
        plan = self._make_plan()
        self._main.configure(plan)
        is_carried = self._main.carrier is not None
        running = (CarriedRunning if is_carried else Running)(
            self._main,
            carried(plan) if is_carried else plan,
            self._wishes,
            abandon=abandon,
            on_axis_stopped=self._on_axis_stopped,
            on_return=self._on_return,
            on_replacement=self._on_replacement,
        )
        running.switch_interval = self._switch_interval
        for law in self._laws:
            running.laws.compile(law)
        if self._sink is not None:
            running.publish(self._sink)
        return running

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is not None:
            self._tell_end(error)
        problems = self._leave()
        if self._background is not None and (untold := self._background.untold_error()) is not None:
            problems.insert(0, untold)
        if error is not None:
            for problem in problems:
                error.add_note(f"on the way down: {problem}")
        elif problems:
            raise problems[0]

    def open(self) -> Self:
        """Enter without a `with` block, for a notebook or a server. Returns the loop.

        `close` leaves it; so do the end of the program and the MainDevice's `close`.
        """
        self.__enter__()
        return self

    def close(self) -> None:
        """Leave the loop: stop the axes, then the cycle. A no-op if it is closed.

        Raises an error that ended the loop in the background, unless another call has raised it.
        """
        if self._running is None:
            return
        if self._running.is_open:
            self._guard.install()  # again: a notebook sets its own handlers in each cell
        self.__exit__(None, None, None)

    def run_in_background(self) -> None:
        """Let a Python thread iterate the loop from now on, and return at once.

        The thread commits the targets in every cycle. Write them in `with loop.update():`. An
        error of the loop stops the axes and closes the loop; the next `update`, `wait` or `close`
        raises it. Interrupting the program (Ctrl-C) does not stop the loop; `close` and the end of
        the program do. In virtual time the thread keeps to the wall clock. A no-op if it runs.

        Raises:
            ValueError: the loop is inline.
            LoopError: an axis is powered in CST.
        """
        if self._background is not None:
            self._background.raise_error()
        running = self._open_running
        if self._background is None:
            background = Background(running, iter(self), self._guard)
            background.start()
            self._background = background

    def update(self) -> AbstractContextManager[None]:
        """Return a context in which a program writes one consistent set of targets and requests.

        While the loop runs in the background, all of the set is committed when the block ends; none
        of it if the block raises. In CSV and CST it counts for `command_timeout`: then CSV
        decelerates, and CST is stopped.

        Raises:
            RuntimeError: the loop does not run in the background: `next(loop)` commits.
            CatenaryError: what ended the loop in the background.
        """
        if self._background is None:
            raise RuntimeError(
                "update() needs run_in_background(): a program that iterates the loop itself "
                "commits all it has written by `next(loop)`"
            )
        return self._background.update()

    def wait(self, awaited: Awaited, *, timeout: float | None = None) -> None:
        """Iterate until `awaited` is done; while the loop runs in the background, only wait.

        Args:
            awaited: a move, or anything else with `done` and `error`.
            timeout: [s]; None: none.

        Raises:
            TimeoutError: it is not done within `timeout`.
            CatenaryError: what ended the loop or the move.
        """
        if self._background is not None:
            return self._background.wait(awaited, timeout)
        for cycle in self:
            if awaited.done:
                break
        return None

    @property
    def error(self) -> Exception | None:
        """Error that ended the loop in the background; None if there is none."""
        return None if self._background is None else self._background.error

    def __iter__(self) -> Iteration:
        """Iterating again goes on where the last iteration ended."""
        running = self._foreground
        if self._iteration is None:
            self._iteration = Iteration(
                running.engine,
                partial(running.judge, faults=self._raise_faults),
                trouble=TROUBLE,
                al_status=State.OP,
                beside=running.service.beside,
            )
            running.service.runner.adopt()
        return self._iteration

    def __next__(self) -> Cycle:
        return next(iter(self))

    def start(
        self,
        law: Law | Callable[..., Any],
        memory: Sequence[float] | Numbers = (),
        parameters: Sequence[float] | Numbers = (),
        *,
        budget: float | None = None,
        overruns: int = 3,
    ) -> LawRun:
        """Start a compiled law. From the next cycle on, it computes the set-points in the cycle
        thread; the loop can be iterated meanwhile, to watch.

        Args:
            law: function or compiled law; it begins from what is commanded.
            memory: its state, float64, at most 4096 numbers.
            parameters: of the application, float64, at most 4096 numbers.
            budget: of one step [s]; None: 0.4 periods; 0: no check. The frames need the rest.
            overruns: number of steps in a row over the budget that end the law.

        Raises:
            LawError: the law cannot be compiled. The iteration raises it for an exception, a
                target that is NaN or infinite, overruns, and a step that never returns.
            ValueError: the budget leaves too little of the period for the frames.
        """
        return self._opened.laws.start(made_law(law), memory, parameters, budget, overruns)

    def run(
        self,
        law: Law | Callable[..., Any],
        memory: Sequence[float] | Numbers = (),
        parameters: Sequence[float] | Numbers = (),
        *,
        budget: float | None = None,
        overruns: int = 3,
        compiled: bool = True,
    ) -> Numbers:
        """Runs a law to its end, as `start` says; the axes hold then. Returns its memory.

        `compiled=False` runs it as Python, in the loop's own thread: slow, with Python's errors, to
        find mistakes.
        """
        running = self._foreground
        if not compiled:
            return self._run_as_python(made_law(law), memory, parameters)
        run = running.laws.start(made_law(law), memory, parameters, budget, overruns)
        running.laws.run(run, ENDING, self._judge)
        return run.memory

    def _run_as_python(
        self,
        law: Law,
        memory: Sequence[float] | Numbers,
        parameters: Sequence[float] | Numbers,
    ) -> Numbers:
        step, kept = self._opened.laws.python_step(law, memory, parameters)
        start: float | None = None
        for cycle in self:
            start = cycle.time if start is None else start
            if cycle.refused:
                raise LawError(f"law {law} left NaN or infinity in a target")
            if step(cycle.time - start):
                break
        return kept

    def stream(self, capacity: int = 1000) -> Stream:
        """A ring of at most `capacity` rows of set-points, one row a cycle, that a slower thread
        fills ahead: see `Stream`."""
        return Stream(self._open_running.engine, self._opened.views, capacity)

    def restore(self, sub: SubDevice) -> None:
        """Lets a device that is held (event DeviceHeld or DeviceReplaced) go to OP: from now on,
        beside the cycle. Returns at once; `sub.state` and the events tell. ValueError for a device
        of another loop."""
        for running in self._runnings:
            if running.main is sub.main:
                return running.watch.release(sub)
        raise ValueError(f"{sub.station} is no device of this loop: it is on another MainDevice")

    def _judge(self, flags: int) -> None:
        running = self._opened
        if running.service.beside is not None:
            running.service.step()
        if flags & TROUBLE or running.engine.al_status != State.OP:
            running.judge(flags, faults=self._raise_faults)

    @property
    def plan(self) -> Plan:
        """What runs: print it."""
        return self._opened.plan

    @property
    def timing(self) -> Timing:
        """The phases of the cycles since the loop was entered; stays readable after it."""
        engine = self._opened.engine
        return Timing(engine.histograms(), engine.counters)

    @property
    def clocks(self) -> Clocks:
        """The distributed clocks: print it. RuntimeError where no wish has `dc=`."""
        clocks = self._opened.clocks
        if clocks is None:
            raise RuntimeError("no distributed clocks in this loop: Drives(..., dc=True)")
        return clocks

    def wait_locked(self, within: float = 1e-6, timeout: float = 5.0) -> None:
        """Cycles, axes holding, until every clock differs by at most `within` [s] from the
        reference clock and the instants are in phase with it. That bound holds from now on: leaving
        it is a `ClockUnlocked` event, coming back `ClockLocked`.

        Raises:
            ClockError: after `timeout` [s].
            LoopError: an axis is powered in CST, whose torque would become stale meanwhile.
        """
        running = self._foreground
        running.refuse_powered_torque("wait_locked")
        self.clocks.wait(within, timeout, self._judge)
        running.judge(CYCLE_CLOCKS, faults=self._raise_faults)

    @property
    def scheduling(self) -> str:
        """Scheduling and locked memory that the cycle thread obtained, as text."""
        return self._opened.engine.scheduling

    @property
    def log(self) -> LogArray:
        """The last cycles (1000, or `log`), oldest first, as a structured array."""
        return self._opened.log()

    def histogram(self, phase: str) -> list[tuple[float, float, int]]:
        """(lower, upper, count) in us of every bucket of a phase of `timing` that is not empty."""
        return self._opened.engine.histogram_counts(phase)

    @property
    def _runnings(self) -> Sequence[Running]:
        """What runs of each network."""
        return [self._opened]

    @property
    def _open_running(self) -> Running:
        running = self._opened
        running.require_open()
        return running

    @property
    def _foreground(self) -> Running:
        """What runs, for a call that iterates."""
        if self._background is not None and self._background.is_alive:
            raise RuntimeError(
                "the loop runs in the background, where a thread iterates it: write targets in "
                "`with loop.update():`, wait with loop.wait(move), start laws with loop.start()"
            )
        return self._open_running

    @property
    def _opened(self) -> Running:
        if self._running is None:
            raise RuntimeError("the loop is not open: with Loop(...) as loop:")
        return self._running

    def _make_plan(self) -> Plan:
        """What the wishes come to; nothing is written to the devices yet."""
        late = self._late_limit
        self._main.read_mappings(*self._wishes, period=self._period)
        return make_plan(
            [sub.description for sub in self._main.subs],
            self._wishes,
            period=self._period,
            order=self._run,
            receive_mode=self._receive,
            watchdog=self._watchdog,
            lost_limit=self._lost_limit,
            late_limit_position=LATE_LIMIT_POSITION if late is None else late,
            late_limit_velocity=LATE_LIMIT_VELOCITY if late is None else late,
            late_limit_torque=LATE_LIMIT_TORQUE if late is None else late,
            handover=self._handover,
            stop_deadline=self._stop_deadline,
            busy_wait=self._busy_wait,
            collect_share=self._collect_deadline,
            log=self._log,
            clock=self._clock,
            reference=None if self._reference is None else self._reference.position,
            margin=self._margin,
            burst=self._burst,
            exact_matching=self._exact_matching,
            cpu=self._cpu,
            priority=self._priority,
        )

    def _abandoned(self) -> Callable[[], object]:
        """Return what leaves the loop when its MainDevice is closed. It does not keep the loop."""
        method = weakref.WeakMethod(self._abandon)

        def abandon() -> None:
            if (leave := method()) is not None:
                leave()

        return abandon

    def _abandon(self) -> None:
        """The MainDevice is being closed while the loop is open."""
        for problem in self._leave():
            warnings.warn(f"the loop was left open: {problem}", RuntimeWarning, stacklevel=2)

    def _leave_at_the_latest(self, runnings: Sequence[Running]) -> None:
        """Leave the loop when it is deleted, or when the program ends, if it is open then."""
        self._finalizer = weakref.finalize(self, leave_open_loop, runnings, self._guard)

    def _tell_end(self, error: BaseException) -> None:
        if self._running is not None:
            self._running.tell_end(error)

    def _leave(self) -> list[Exception]:
        try:
            if self._running is not None:
                return self._running.leave(self._guard)
            return take_down(self._main)
        finally:
            self._guard.restore()
            if self._finalizer is not None:
                self._finalizer.detach()


def leave_open_loop(runnings: Sequence[Running], guard: SignalGuard) -> None:
    """Stop the axes of a loop that nothing refers to any more, then warn: a warning may be an
    error. A loop in the background may stay open until the program ends."""
    if not any(running.is_open for running in runnings):
        return
    for running in runnings:
        if running.is_open:
            running.stop_axes_at_once()
    problems = [problem for running in runnings for problem in running.leave(guard)]
    guard.restore()
    if _program_ends() and not problems and all(one.in_background for one in runnings):
        return
    text = "a Loop was not left: its axes have been stopped. Use it in a with block, or close() it"
    text += "".join(f"; {problem}" for problem in problems)
    warnings.warn(text, RuntimeWarning, stacklevel=2)


def _program_ends() -> bool:
    """Return True in the functions of `atexit`: Python marks its main thread as ended before."""
    return not threading.main_thread().is_alive()

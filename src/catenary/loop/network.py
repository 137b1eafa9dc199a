"""Network: the part of a loop that runs on one MainDevice."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from catenary.bus import MainDevice
from catenary.core import (
    CYCLE_CLOCKS,
    CYCLE_DROPPED,
    CYCLE_LAW_FAILED,
    CYCLE_NONE,
    CYCLE_STOPPED,
    CYCLE_WORKING_COUNTER,
)
from catenary.errors import ConfigurationError, LawError
from catenary.log import Log
from catenary.loop.capture_options import CaptureOptions
from catenary.loop.clock_discipline import DisciplineOptions
from catenary.loop.clocks import Clocks
from catenary.loop.devices import LoopRequest
from catenary.loop.external_cycle import CarriedExchange, carried
from catenary.loop.frame_capture import FrameCapture
from catenary.loop.frame_exchange import FrameExchange
from catenary.loop.laws.law import Law
from catenary.loop.options import ClockOptions, Scheduling, StopPolicy, check_groups, one_of
from catenary.loop.session import Session, take_down
from catenary.loop.stream import Stream
from catenary.loop.timing import Timing
from catenary.loop.watches.diagnosis import DiagnosisWatch
from catenary.loop.watches.external_clock import ExternalClockWatch
from catenary.loop.watches.trigger import TriggerWatch
from catenary.plan.cycle import ExecutionMode, ReceiveMode
from catenary.plan.options import PlanOptions, period_in_ns
from catenary.plan.planner import Plan, make_plan
from catenary.plan.sink import ServingSink, Sink
from catenary.plan.trigger import Trigger
from catenary.wire.al import AlState

ENDING = CYCLE_WORKING_COUNTER | CYCLE_DROPPED | CYCLE_STOPPED | CYCLE_NONE | CYCLE_LAW_FAILED
TROUBLE = ENDING | CYCLE_CLOCKS
LAW_SLICE_NS = 10_000_000  # between checks for signals while a law runs
DIAGNOSIS_MAX = 3600.0  # [s]
LOG_LIMIT = 2**24  # cycles, about a gigabyte


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Options of a loop that all of its networks share.

    Raises:
        ValueError: An option is impossible.
        TypeError: A group of options has the wrong type.
    """

    period: float
    execution: ExecutionMode
    watchdog: float | None
    priority: int | None
    log: int
    log_axes: bool
    stop: StopPolicy
    scheduling: Scheduling
    clocks: ClockOptions
    trigger: Trigger | None
    capture: CaptureOptions | None
    diagnosis: float | None

    def __post_init__(self) -> None:
        one_of("execution", self.execution, ("threaded", "inline"))
        check_groups(self.stop, self.scheduling, self.clocks)
        period_in_ns(self.period)
        busy_wait = self.scheduling.busy_wait
        if busy_wait >= self.period:
            raise ValueError(
                f"busy_wait={busy_wait} s: must be less than the period of {self.period} s"
            )
        if not 1 <= self.log <= LOG_LIMIT:
            raise ValueError(f"log={self.log} cycles: must be 1 to {LOG_LIMIT}")
        if self.diagnosis is not None and not 0.0 < self.diagnosis <= DIAGNOSIS_MAX:
            raise ValueError(
                f"diagnosis={self.diagnosis} s: must be above 0, at most {DIAGNOSIS_MAX:g} s"
            )
        self._check_trigger()

    def _check_trigger(self) -> None:
        if self.trigger is None:
            return
        if isinstance(self.trigger, type) or not hasattr(self.trigger, "sends"):
            raise TypeError(
                f'trigger={self.trigger!r}: use cat.share.TriggerSender("name") or '
                'cat.share.TriggerReceiver("name")'
            )
        if self.execution != "threaded":
            raise ValueError('trigger= needs execution="threaded"')
        if self.clocks.external is not None and not self.trigger.sends:
            raise ValueError(
                "trigger= and external=: the cycle starts cannot follow a trigger and a clock; let "
                "the sender of the trigger follow the clock"
            )

    def plan_options(self, main: MainDevice, cpu: int | None) -> PlanOptions:
        """Return the options of one network's plan.

        Args:
            main: MainDevice of the network.
            cpu: CPU of its native thread; None: any CPU of the process.
        """
        late_position, late_velocity, late_torque = self.stop.late_limits
        command_velocity, command_torque = self.stop.command_timeouts
        reference = self.clocks.reference
        if reference is not None and reference.main is not main:
            reference = None  # it is a device of another network of the loop
        by_execution: ReceiveMode = "poll" if self.execution == "inline" else "wait"
        return PlanOptions(
            period=self.period,
            execution=self.execution,
            receive_mode=self.scheduling.receive or by_execution,
            watchdog=self.watchdog,
            lost_limit=self.stop.lost_limit,
            late_limit_position=late_position,
            late_limit_velocity=late_velocity,
            late_limit_torque=late_torque,
            handover=self.stop.handover,
            command_timeout_velocity=command_velocity,
            command_timeout_torque=command_torque,
            stop_deadline=self.stop.stop_deadline,
            busy_wait=self.scheduling.busy_wait,
            collect_share=self.scheduling.collect_deadline,
            log=self.log,
            log_axes=self.log_axes,
            cpu=cpu,
            priority=self.priority,
            clock=self.clocks.followed,
            reference=None if reference is None else reference.position,
            margin=self.clocks.margin,
            burst=self.clocks.burst,
            exact_matching=self.scheduling.exact_matching,
        )


class Network:
    """One network of a loop: its MainDevice, session, plan, timing, clocks and log."""

    def __init__(
        self,
        main: MainDevice,
        requests: Sequence[LoopRequest],
        settings: Settings,
        *,
        cpu: int | None,
        sink: Sink | None,
        laws: Sequence[Law],
    ) -> None:
        self.main = main
        self.current_session: Session | None = None
        self._capture: FrameCapture | None = None
        self.number = 0  # of this network in the loop
        self.count = 1  # networks of the loop
        self.requests = requests
        self._settings = settings
        self._cpu = cpu
        self._sink = sink
        self._laws = laws  # to compile before OP

    @property
    def plan(self) -> Plan:
        """Plan of the network; `print` shows it as text."""
        return self.session.plan

    @property
    def timing(self) -> Timing:
        """Timing of the cycles since the loop was opened; also available when it is closed."""
        return self.session.timing()

    @property
    def clocks(self) -> Clocks:
        """Distributed clocks of the network; `print` shows them as a table.

        Raises:
            RuntimeError: No request has `dc=`.
        """
        clocks = self.session.clocks
        if clocks is None:
            raise RuntimeError(
                "no distributed clocks in this loop: request them with Drives(..., dc=True)"
            )
        return clocks

    @property
    def external(self) -> ExternalClockWatch:
        """External clock that the cycle starts follow; `print` shows its state.

        Raises:
            RuntimeError: The loop has no external clock.
        """
        watch = self.session.external
        if watch is None:
            raise RuntimeError(
                'no external clock in this loop: use ClockOptions(external="/dev/ptp0")'
            )
        return watch

    @property
    def trigger(self) -> TriggerWatch:
        """Trigger that the loop sends or awaits.

        Raises:
            RuntimeError: The loop has no trigger.
        """
        watch = self.session.trigger
        if watch is None:
            raise RuntimeError(
                "no trigger in this loop: use Loop(trigger=cat.share.TriggerReceiver(...))"
            )
        return watch

    @property
    def scheduling(self) -> str:
        """Scheduling and locked memory that the cycle thread obtained, as text."""
        return self.session.engine.scheduling

    @property
    def log(self) -> Log:
        """The last cycles, oldest first; see `Log`."""
        return self.session.log()

    def histogram(self, phase: str) -> list[tuple[float, float, int]]:
        """Return (lower [s], upper [s], count) of every non-empty bucket of a phase of `timing`."""
        return self.session.engine.histogram_counts(phase)

    def stream(self, capacity: int = 1000) -> Stream:
        """Return a `Stream` of set-points for the axes of this network."""
        self.session.require_open()
        return Stream(self.session.engine, self.session.views, capacity)

    @property
    def session(self) -> Session:
        """Session of the network. Raises RuntimeError before the loop is open."""
        if self.current_session is None:
            raise RuntimeError("the loop is not open: use `with Loop(...) as loop:`")
        return self.current_session

    def prepare(self, abandon: Callable[[], object]) -> Session:
        """Bring all devices to SAFE-OP, and return the session.

        This also compiles the laws of the options and opens the sink.

        Args:
            abandon: Function that leaves the loop. It is called when the MainDevice is closed.
        """
        self.current_session = None
        self._capture = self._begin_capture()
        plan = self._make_plan()
        self.main.configure(plan)
        is_carried = self.main.carrier is not None
        session = Session(
            self.main,
            carried(plan) if is_carried else plan,
            self.requests,
            abandon=abandon,
            stop=self._settings.stop,
            exchange=CarriedExchange if is_carried else FrameExchange,
        )
        session.capture = self._capture
        session.switch_interval = self._settings.scheduling.switch_interval
        self._compile_laws(session)
        session.external = self._make_external(session)
        session.diagnosis = self._make_diagnosis(session)
        if self._settings.trigger is not None:
            session.attach_trigger(self._make_trigger(self._settings.trigger, session))
        self.current_session = session
        if self._sink is not None:
            session.publish(self._sink)
        if isinstance(self._sink, ServingSink):
            self._sink.serve(self)
        return session

    def _begin_capture(self) -> FrameCapture | None:
        """Keep the frames from now on; None without captures.

        Raises:
            ConfigurationError: Another master makes the frames, or the folder cannot be written.
        """
        options = self._settings.capture
        if options is None:
            return None
        if self.main.carrier is not None:
            raise ConfigurationError(
                "capture= is not possible: an external master makes the frames",
                hint="omit the option, or open the network interface directly",
            )
        return FrameCapture(options, self.main)

    def _make_diagnosis(self, session: Session) -> DiagnosisWatch | None:
        """Return the watch of the devices' own diagnosis; None without the option."""
        interval = self._settings.diagnosis
        if interval is None:
            return None
        engine = session.engine
        return DiagnosisWatch(
            self.main.subs,
            interval,
            put=self.main.events.put,
            now=lambda: engine.now() * 1e-9,
        )

    def report_end(self, error: BaseException) -> None:
        """Report the error that ends the loop to the sink and to the capture."""
        if self.current_session is not None:
            self.current_session.report_end(error)
        elif self._capture is not None:
            self._capture.fail(error)

    def take_down(self) -> list[Exception]:
        """Bring the devices of a network without a session to PRE-OP; return the problems.

        Then end the capture. No effect if the network has a session, which does the same.
        """
        if self.current_session is not None:
            return []
        problems = take_down(self.main)
        try:
            if self._capture is not None:
                self._capture.end()
        except Exception as problem:  # it must not hide the error of the loop
            problems.append(problem)
        return problems

    def _compile_laws(self, session: Session) -> None:
        """Compile the laws of the options. Raise LawError with the number of the network."""
        try:
            for law in self._laws:
                session.laws.compile(law)
        except LawError as error:
            if self.count > 1:
                error.add_note(
                    f"the law was compiled for network {self.number} of {self.count}: give each "
                    "network its own laws with Loop(laws=[[...], [...]])"
                )
            raise

    def _make_trigger(self, trigger: Trigger, session: Session) -> TriggerWatch:
        """Return the watch of the trigger.

        Raises:
            ConfigurationError: Another master makes the frames, or the loop awaits the trigger and
                has distributed clocks.
        """
        cycle = session.plan.cycle
        if self.main.carrier is not None:
            raise ConfigurationError(
                "trigger= is not possible: an external master makes the frames",
                hint="omit the option, or open the network interface directly",
            )
        if not trigger.sends and cycle.clock is not None:
            raise ConfigurationError(
                "the cycle starts of a loop that awaits a trigger move when the sender restarts: "
                "distributed clocks cannot follow them",
                hint="omit dc=, or run both networks in one loop",
            )
        return TriggerWatch(trigger, session.engine, cycle.period_ns, self.main.events.put)

    def _make_external(self, session: Session) -> ExternalClockWatch | None:
        """Return the watch of the external clock; None without one.

        Raises:
            ClockError: The clock cannot be opened.
            ConfigurationError: Another master makes the frames.
        """
        clock = self._settings.clocks.external_clock
        if clock is None:
            return None
        if self.main.carrier is not None:
            raise ConfigurationError(
                "external= is not possible: an external master makes the frames",
                hint="omit the option, or open the network interface directly",
            )
        engine, cycle = session.engine, session.plan.cycle
        options = DisciplineOptions(
            period_ns=cycle.period_ns,
            phase_ns=round(clock.phase * 1e9) + (cycle.clock.phase_ns if cycle.clock else 0),
            rate_limit=clock.rate_limit,
            bound_ns=round(clock.within * 1e9),
        )
        return ExternalClockWatch(
            clock,
            options,
            now_ns=engine.now,
            cycle_start_ns=lambda: engine.scheduled_ns,
            steer=engine.steer,
            put=self.main.events.put,
        )

    def _make_plan(self) -> Plan:
        """Update the mappings from the devices, and return the plan of the requests."""
        its = self._settings
        self.main.read_mappings(*self.requests, period=its.period)
        devices = [sub.description for sub in self.main.subs]
        return make_plan(devices, self.requests, its.plan_options(self.main, self._cpu))

    def advance_law(self) -> None:
        """Wait for the end of the law, at most a slice of time, and raise the error of a cycle."""
        self.advance(self.session.engine.run_law(LAW_SLICE_NS, ENDING))

    def advance(self, flags: int) -> None:
        """Judge a cycle that ran without an iteration, and raise its error, if any.

        In virtual time, first step the acyclic queue.

        Args:
            flags: Flags of the cycle.
        """
        session = self.session
        session.service.step_without_thread()
        if flags & TROUBLE or session.engine.al_status != AlState.OP:
            session.judge(flags)

    def wait_locked(self, within: float, timeout: float) -> None:
        """Wait until the clocks are locked: see `Loop.wait_locked`.

        Args:
            within: Bound [s].
            timeout: Longest wait [s].
        """
        self.clocks.wait(within, timeout, self.advance)
        self.session.judge(CYCLE_CLOCKS)


def leave_method(loop_leave: Callable[[], None]) -> Callable[[], object]:
    """Return a function that calls a bound method without keeping its object alive."""
    method = weakref.WeakMethod(loop_leave)

    def call() -> None:
        if (leave := method()) is not None:
            leave()

    return call

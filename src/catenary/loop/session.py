"""Session of an open loop: the engine, its arrays and the acyclic queue of one MainDevice."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack

import numpy as np
import numpy.typing as npt

from catenary.bus import MainDevice, Pending
from catenary.core import (
    AXIS_FOLLOWED,
    CYCLE_CLOCKS,
    CYCLE_DROPPED,
    CYCLE_NONE,
    CYCLE_OK,
    CYCLE_STOPPED,
    CYCLE_WORKING_COUNTER,
    REQUEST_ENABLED,
    REQUEST_RESET,
)
from catenary.errors import CatenaryError, LinkError, LoopError
from catenary.link import forget_in_child
from catenary.log import Log
from catenary.loop.acyclic_service import Service
from catenary.loop.buffers import bind_requests
from catenary.loop.clocks import Clocks
from catenary.loop.exchange import Exchange
from catenary.loop.fault_report import FaultReport
from catenary.loop.frame_capture import FrameCapture
from catenary.loop.interpreter import switch_interval
from catenary.loop.laws.runner import LawRunner
from catenary.loop.options import StopPolicy
from catenary.loop.publishing import Publisher
from catenary.loop.safe_outputs import confirm_safe, make_safe
from catenary.loop.signals import SignalGuard
from catenary.loop.timing import Timing
from catenary.loop.watches.diagnosis import DiagnosisWatch
from catenary.loop.watches.external_clock import ExternalClockWatch
from catenary.loop.watches.trigger import TriggerWatch
from catenary.plan.planner import Plan
from catenary.plan.request import ProcessDataRequest, Views
from catenary.plan.sink import Sink
from catenary.procedure.sercos_fault import reset_fault
from catenary.wire.al import AlState
from catenary.wire.cia402 import IN_FAULT, POWERED, AxisState, Mode

FATAL = CYCLE_WORKING_COUNTER | CYCLE_STOPPED | CYCLE_NONE
ENABLE_TIMEOUT_NS = 5_000_000_000  # longer than slow mains contactors and brakes take
ENABLE_CYCLES = 20  # shortest timeout [cycles], for long periods
SETTLE_CYCLES = 50  # longest wait for the first cycle with all answers
REQUESTED_SHIFT = 6  # place of the requested state in `Views.axis_flags`
STOP_SLICE_NS = 20_000_000  # between checks of `guard.hurry` while the drives brake


class Session:
    """State of one MainDevice in a loop: engine, arrays, acyclic queue and watches."""

    def __init__(
        self,
        main: MainDevice,
        plan: Plan,
        requests: Sequence[ProcessDataRequest],
        *,
        abandon: Callable[[], object],
        stop: StopPolicy,
        exchange: Callable[[Session], Exchange],
    ) -> None:
        self.main, self.plan = main, plan
        self.exchange: Exchange = exchange(self)
        self.engine = self.exchange.make_engine()
        self.views = self._bind(requests)
        self.stop, self._abandon = stop, abandon  # `abandon`: if the MainDevice is closed first
        self.laws = LawRunner(self.engine, plan)
        self.faults = FaultReport(
            main, plan.cycle, self.engine, self.views, self.exchange, self.laws, stop
        )
        self.clocks = self._make_clocks()
        self.service = Service(main, self.engine, plan)
        self.exchange.attend()
        self.watch = self.exchange.watch
        self.switch_interval: float | None = None  # [s] of the interpreter; used by an inline loop
        self.diagnosis: DiagnosisWatch | None = None
        self.external: ExternalClockWatch | None = None
        self.capture: FrameCapture | None = None
        self.trigger: TriggerWatch | None = None
        self._attached = ExitStack()
        self._opened = self._left = False
        self._process = os.getpid()
        forget_in_child(self)
        self._companions: Sequence[Session] = ()
        self._watches: list[Pending[None]] = []
        self._publisher: Publisher | None = None
        self._counted: Mapping[str, int] = {}  # counters of the engine when the loop was entered
        self.end_background: Callable[[], None] = _no_background  # ends the thread that iterates
        # In the background: begins a consistent set of targets, as `Loop.update`
        self.update: Callable[[], AbstractContextManager[None]] | None = None
        self.service.cycle = self.cycle

    def _bind(self, requests: Sequence[ProcessDataRequest]) -> Views:
        """Bind the requests to their parts of the engine's buffers; return views of all buffers."""
        return bind_requests(
            requests,
            self.plan.tables,
            self.engine.buffers,
            is_open=lambda: self.is_open,
            is_led=lambda: self.engine.led,
            system_time=lambda: None if self.clocks is None else self.clocks.cycle_start_ns,
        )

    def _make_clocks(self) -> Clocks | None:
        clock = self.plan.cycle.clock
        if clock is None:
            return None
        return Clocks(self.main, self.engine, self.exchange.cycle_clock(), clock, self.cycle)

    # Opening

    def publish(self, sink: Sink) -> None:
        """Publish every cycle to the sink, from the first one on."""
        self._publisher = Publisher(sink, self.main, self.engine, self.plan)

    def attach_trigger(self, watch: TriggerWatch) -> None:
        """Start the cycles with those of another process, or the reverse; leaving releases it."""
        self.trigger = watch
        self._attached.callback(watch.close)

    def report_end(self, error: BaseException) -> None:
        """Publish the error that ends the loop, and keep the frames around it."""
        if self.capture is not None:
            self.capture.fail(error)
        if self._publisher is not None:
            self._publisher.report_end(error)

    def share_time(self, companions: Sequence[Session]) -> None:
        """Let this thread also run the cycles of other networks, in virtual time."""
        self._companions = companions
        self.engine.take_turns()

    def cycle(self) -> int:
        """Run one cycle of this and of each companion network, without the application.

        Returns:
            Flags of the cycle of this network.
        """
        flags = self.engine.run(1)
        for other in self._companions:
            if other.is_open:
                other.engine.run(1)
                other.service.step()
        return flags

    @property
    def is_open(self) -> bool:
        """True while the loop is open in this process."""
        return self._opened and not self._left and self._process == os.getpid()

    @property
    def in_background(self) -> bool:
        """True if a background thread iterates, or did until the loop was left."""
        return self.end_background is not _no_background

    def require_open(self) -> None:
        """Raise RuntimeError for a call that needs cycles, unless the loop is open."""
        if self._process != os.getpid():
            raise RuntimeError("the loop runs in the parent process: a forked child cannot use it")
        if not self.is_open:
            raise RuntimeError("the loop is closed: open it again, or use it in a with block")

    def open(self, origin_ns: int = 0) -> None:
        """Start the cycle, and bring the devices from SAFE-OP to OP while it sends valid outputs.

        Args:
            origin_ns: Cycle start of the schedule to follow [ns]; 0: a new schedule.
        """
        self._attached.enter_context(
            self.main.attached(self.service.runner, self._abandon, self.powered_axes)
        )
        inline = self.plan.cycle.execution == "inline" and self.engine.scheduling != "virtual time"
        if inline and self.switch_interval is not None:
            self._attached.enter_context(switch_interval(self.switch_interval))
        if self.external is not None:
            self._attached.callback(self.external.close)
        engine = self.engine
        self.main.events.begin_loop(lambda: engine.zero_ns)
        self.engine.start(origin_ns)
        self._opened = True
        self.service.start()
        self._watches = self.exchange.bring_to_op()

    def enable(self) -> None:
        """Reset faults and enable all axes.

        Position axes hold when this returns. Velocity and torque axes wait for their first targets.

        Raises:
            DriveError: A fault cannot be reset, or a position axis cannot be enabled in time.
            CatenaryError: The cycle failed.
        """
        in_position = np.isin(self.views.mode_target, (Mode.CSP, Mode.PP))
        self._reset_sercos()
        if (
            ~in_position & self._in_fault()
        ).any():  # the reset by `enable` would come after their first targets
            self._request(REQUEST_RESET, ~in_position & self._in_fault())
            self._await(lambda: ~in_position & self._in_fault())
        self._request(REQUEST_ENABLED, np.ones_like(in_position))
        self._await(
            lambda: (
                in_position
                & (self.views.axis_flags & AXIS_FOLLOWED == 0)
                & (self.views.jogged == 0)
            )
        )

    def _reset_sercos(self) -> None:
        """Reset the faults of SERCOS drives: their control word has no bit for a reset.

        A drive that still brakes after its fault refuses the reset.
        """
        is_sercos = np.array([each.profile == "sercos" for each in self.plan.cycle.axes], bool)
        if not (is_sercos & self._in_fault()).any():
            return
        self._await(lambda: is_sercos & (self.views.axis_state == AxisState.FAULT_REACTION_ACTIVE))
        for k in np.flatnonzero(is_sercos & self._in_fault()).tolist():
            axis = self.plan.cycle.axes[k]
            channel = self.main.subs[axis.device].channel
            assert channel is not None  # its telegrams were read through it
            try:
                self.service.converse(reset_fault(channel, axis.slot))
            except CatenaryError as error:
                raise self.faults.drive_error([k], "cannot be reset") from error

    def _request(self, state: int, axes: npt.NDArray[np.bool_]) -> None:
        self.views.requested_state[axes] = state
        self.views.request[axes] += 1

    def _in_fault(self) -> npt.NDArray[np.bool_]:
        """Return (n,) True for each axis that is in fault or in its fault reaction."""
        return np.isin(self.views.axis_state, [int(state) for state in IN_FAULT])

    def _await(self, waiting: Callable[[], npt.NDArray[np.bool_]]) -> None:
        """Run cycles until no axis is waiting; raise DriveError at the timeout."""
        timeout_ns = max(ENABLE_TIMEOUT_NS, ENABLE_CYCLES * self.plan.cycle.period_ns)
        deadline = self.engine.now() + timeout_ns
        while True:
            flags = self.cycle()
            if flags & CYCLE_DROPPED:
                self.faults.report_axes()
            axes = np.flatnonzero(waiting()).tolist()
            if not axes:
                return
            if flags & FATAL or self.engine.al_status != AlState.OP:
                self.judge(flags, enabling=True)
            if self.engine.now() > deadline:
                raise self.faults.drive_error(axes, "cannot be enabled")

    def powered_axes(self) -> list[str]:
        """Return the axes that have power, or are requested to be enabled.

        A request counts before it is committed. The states are those of the last iteration.
        """
        views = self.views
        powered = np.isin(views.axis_state, POWERED) | (views.requested_state == REQUEST_ENABLED)
        powered |= views.axis_flags >> REQUESTED_SHIFT == REQUEST_ENABLED
        powered |= views.jogged != 0
        axes = self.plan.cycle.axes
        return [axes[i].name for i in np.flatnonzero(powered)]

    def refuse_powered_torque(self, call: str) -> None:
        """Raise LoopError if an axis is powered in CST, since `call` commits no torque."""
        views = self.views
        in_torque = (views.mode_target == Mode.CST) | (views.mode_actual == Mode.CST)
        powered = (views.axis_state == AxisState.OPERATION_ENABLED) & in_torque
        if not powered.any():
            return
        names = [self.plan.cycle.axes[i].name for i in np.flatnonzero(powered).tolist()]
        raise LoopError(
            f"{call} is not possible: {', '.join(names)} powered in CST, and "
            "the call commits no torque set-points",
            log=self.log(),
            hint="call it before the first torque is committed, disable the axes, or switch to CSP",
        )

    def settle(self) -> None:
        """Run cycles until all units answer. The first cycles of a thread may have no answers.

        Raises:
            WorkingCounterError: A unit is silent in each of SETTLE_CYCLES cycles.
            LoopError: The cycle has ended.
        """
        for _ in range(SETTLE_CYCLES):
            flags = self.cycle()
            self.raise_ended(flags)
            if flags & CYCLE_OK:
                return
        raise self.faults.silence()

    # While the loop is open

    def reset_figures(self) -> None:
        """Restart the timing and the figures of the clocks."""
        self.engine.reset_histograms()
        if self.clocks is not None:
            self.clocks.reset()
        self._counted = self.engine.counters

    def timing(self) -> Timing:
        """Return the timing since `reset_figures`."""
        engine = self.engine
        since = {name: n - self._counted.get(name, 0) for name, n in engine.counters.items()}
        period = self.plan.cycle.period_ns * 1e-9
        return Timing(engine.histograms(), since, period=period, scheduling=engine.scheduling)

    def judge(self, flags: int, *, enabling: bool = False) -> None:
        """Put the events of a cycle, and raise the exception that ends the loop, if any.

        Before this, end moves that cannot continue. See `FaultReport.error` for further effects.

        Args:
            flags: Flags of the cycle.
            enabling: True while the drives are being enabled: a fault is then not an error.
        """
        for mover in list(self.views.movers):
            mover.check()
        if flags & CYCLE_CLOCKS:
            self.announce_clocks()  # before the queries, which take time and can fail
        error = self.faults.error(flags, enabling=enabling)
        if error is not None:
            raise error

    def announce_clocks(self) -> None:
        """Put an event if the clocks have become locked or unlocked."""
        if self.clocks is not None:
            self.clocks.announce()

    def raise_ended(self, flags: int) -> None:
        """Raise LoopError for a cycle that was not run."""
        if (error := self.faults.ended(flags)) is not None:
            raise error

    def log(self) -> Log:
        """Return the last cycles, oldest first."""
        return self.faults.log()

    # Leaving

    def forget(self) -> None:
        """Release the cycle, threads and devices in a forked child: they belong to the parent."""
        self._left = True
        self.engine.forget()
        if self.trigger is not None:
            self.trigger.close()  # the parent keeps its lock

    def leave(self, guard: SignalGuard) -> list[Exception]:
        """Stop the loop and return the problems. A failed step does not prevent the next ones.

        A second call has no effect. In a forked child, the call only does `forget`.
        """
        if self._process != os.getpid():
            self.forget()
        if self._left:
            return []
        self._left = True
        self.make_outputs_safe()
        steps: tuple[Callable[[SignalGuard], None], ...] = (
            self._end_moves,
            self._stop_axes,
            self._confirm_safe_outputs,
            self._stop_cycle,
            self._report_watches,
            self._take_down,
        )
        problems: list[Exception] = []
        for step in steps:
            try:
                step(guard)
            except (
                Exception
            ) as problem:  # the next steps are more important; all problems are returned
                problems.append(problem)
        self._end_capture(problems)
        self.main.events.end_loop()
        return problems

    def _end_capture(self, problems: list[Exception]) -> None:
        """End the capture of the frames. The first problem of leaving is an error, too.

        Args:
            problems: Problems while leaving; a failure of the capture is added.
        """
        if self.capture is None:
            return
        if problems:
            self.capture.fail(problems[0])
        try:
            self.capture.end()
        except Exception as problem:  # all problems are returned
            problems.append(problem)

    def make_outputs_safe(self) -> None:
        """Set the output bytes of process data to their safe values. The next cycle sends them."""
        make_safe(self.plan.cycle, self.views)

    def _confirm_safe_outputs(self, guard: SignalGuard) -> None:
        if self._opened:
            self.engine.end_copies()  # after the axes have stopped
            confirm_safe(self.plan.cycle, self.views, self.cycle, guard)

    def _end_moves(self, guard: SignalGuard) -> None:
        for mover in list(self.views.movers):
            mover.end()

    def _stop_axes(self, guard: SignalGuard) -> None:
        """End the law, and request a quick stop of all axes (0x605A).

        Run cycles until the axes rest, at most until the deadline. A second signal ends the wait.
        """
        self.engine.stop_law()
        if not self.plan.cycle.axes:
            return
        self.stop_axes_at_once()
        for _ in range(self.plan.cycle.stop_deadline_ns // STOP_SLICE_NS + 1):
            if guard.hurry or self.engine.run_until_stopped(STOP_SLICE_NS):
                return

    def stop_axes_at_once(self) -> None:
        """Stop all axes from the next cycle on; replace requests that are not committed yet."""
        self.faults.stop_axes()

    def _stop_cycle(self, guard: SignalGuard) -> None:
        try:
            self.service.end()
        finally:
            self.engine.stop()
            self._attached.close()  # from here on, other threads may use the link
            if self._publisher is not None:
                self._publisher.close()

    def _report_watches(self, guard: SignalGuard) -> None:
        """Raise the error of a watch. A watch is endless, so one that has ended has failed."""
        for watch in self._watches:
            if watch.error is not None and not isinstance(watch.error, LoopError):
                raise watch.error

    def _take_down(self, guard: SignalGuard) -> None:
        try:
            self.main.leave()
        except LinkError:
            if any(self.watch.requires(sub.position) for sub in self.main.subs):
                raise  # otherwise only optional devices do not answer


def _no_background() -> None:
    """Do nothing: the program iterates the loop itself."""


def take_down(main: MainDevice) -> list[Exception]:
    """Bring the devices of a loop that never ran a cycle to PRE-OP; return the problems."""
    try:
        main.leave()
    except CatenaryError as problem:
        return [problem]
    return []

"""Conversion of a bad cycle into events and into the one exception that ends the loop.

Every fault of a loop takes this path (docs/explanation/architecture.md, "How a fault reaches you").
The other modules find facts: the core sets flags, the watches put events, an exchange queries the
devices.
"""

from __future__ import annotations

from collections.abc import Sequence

from catenary.bus import MainDevice
from catenary.core import (
    CYCLE_DROPPED,
    CYCLE_LAW_FAILED,
    CYCLE_NONE,
    CYCLE_STOPPED,
    CYCLE_WORKING_COUNTER,
    REQUEST_QUICK_STOP,
    Engine,
)
from catenary.errors import CatenaryError, DriveError, LoopError, StateError, WorkingCounterError
from catenary.log import Log
from catenary.loop.cycle_errors import (
    AxisTrouble,
    address_error,
    drive_error,
    silence_error,
    state_error,
)
from catenary.loop.exchange import Exchange
from catenary.loop.laws.runner import LawRunner
from catenary.loop.log_rows import read_log
from catenary.loop.options import StopPolicy
from catenary.loop.stop_error import stopped_error
from catenary.loop.watches.axis import AxisWatch, RefusedMode, StoppedAxis
from catenary.plan.cycle import CyclePlan
from catenary.plan.request import Views
from catenary.plan.stop_reason import UNASKED, StopReason
from catenary.wire.al import AlState
from catenary.wire.cia402 import IN_FAULT, state_of

RAISED = {  # stops that raise DriveError with the state of the drive, in order of precedence
    StopReason.FAULT: "in fault",
    StopReason.LEFT_OPERATION: "left OPERATION_ENABLED by itself",
}


class FaultReport:
    """Converter of cycle flags to events and to the exception that ends the loop."""

    def __init__(
        self,
        main: MainDevice,
        plan: CyclePlan,
        engine: Engine,
        views: Views,
        exchange: Exchange,
        laws: LawRunner,
        policy: StopPolicy,
    ) -> None:
        self._main = main
        self._plan = plan
        self._engine = engine
        self._views = views
        self._exchange = exchange
        self._laws = laws
        self._policy = policy
        self._axis_watch = AxisWatch(views, plan.axes, lambda: engine.stopper)

    def error(self, flags: int, *, enabling: bool = False) -> CatenaryError | None:
        """Put the events of a cycle, and return the exception that ends the loop, if any.

        The first cause found in this order counts: end of the cycle, missing answers, law, device
        out of OP, drive. The call can query the devices, which runs further cycles. For missing
        answers and for drives, it also stops all axes.

        Args:
            flags: Flags of the cycle.
            enabling: True while the drives are being enabled: a fault is then not an error.
        """
        ended = self.ended(flags)
        if ended is not None:
            return ended
        stops = self.report_axes() if flags & CYCLE_DROPPED else []
        if flags & CYCLE_WORKING_COUNTER:
            return self.silence()
        failed = self._laws.failure(self.log()) if flags & CYCLE_LAW_FAILED else None
        if failed is not None:
            return failed
        if self._engine.al_status != AlState.OP and not self._exchange.watch.excuses:
            out_of_op = self._out_of_op()
            if out_of_op is not None:
                return out_of_op
            # The flags of the cycles during the query were not judged.
            stops += self.report_axes(explained=True)
        return self._axis_error(stops, raise_faults=self._policy.raise_faults and not enabling)

    def ended(self, flags: int) -> LoopError | None:
        """Return the error for a cycle that was not run; None if the cycle was run."""
        if flags & CYCLE_STOPPED:
            return LoopError("the cycle has ended: the link failed", log=self.log())
        if flags & CYCLE_NONE:
            return LoopError(
                "cycle thread stalled: no cycle completed within 1 s",
                log=self.log(),
                hint="the native thread does not get the CPU: see loop.scheduling",
            )
        return None

    def silence(self) -> WorkingCounterError:
        """Stop the axes, query the devices, and return the error for cycles without answers."""
        lost, log, suspects = self._engine.lost_in_row, self.log(), self._suspects()
        self.stop_axes()  # before the queries, for the devices that still answer
        return silence_error(self._exchange.query_silence(suspects), suspects, lost, log)

    def drive_error(self, axes: Sequence[int], what: str) -> DriveError:
        """Stop all axes, and return the error for the axes in trouble.

        Args:
            axes: Numbers of the axes in trouble.
            what: Fact to report: "in fault", "cannot be enabled".
        """
        log = self.log()
        states = [state_of(self._views.statusword.item(axis)) for axis in axes]
        self.stop_axes()
        troubles = [
            AxisTrouble(self._plan.axes[axis].name, state, self._exchange.error_code(axis))
            for axis, state in zip(axes, states, strict=True)
        ]
        return drive_error(troubles, what, log)

    def report_axes(self, *, explained: bool = False) -> list[StoppedAxis]:
        """Put an event for each refused mode, and for each axis that the core stopped by itself.

        Args:
            explained: True if the call has another reason: see `AxisWatch.new_refusals`.

        Returns:
            The new stops, including the requested ones.
        """
        stops = self._axis_watch.new_stops()
        refusals = self._axis_watch.new_refusals(explained=explained or bool(stops))
        now = self._engine.now() * 1e-9
        news: list[StoppedAxis | RefusedMode] = [stop for stop in stops if not stop.requested]
        for each in [*news, *refusals]:
            self._main.events.put(each.event(now, self._main.subs[each.device]))
        return stops

    def stop_axes(self) -> None:
        """Stop all axes from the next cycle on; replace requests that are not committed yet."""
        self._views.requested_state[:] = REQUEST_QUICK_STOP
        self._views.request[:] += 1
        self._engine.quick_stop_all()

    def log(self) -> Log:
        """Return the last cycles, oldest first."""
        return read_log(self._engine, self._plan)

    def _suspects(self) -> list[int]:
        """Return the positions of required devices whose sync unit did not answer last."""
        valid = self._engine.buffers["unit_valid"].tolist()
        return [
            position
            for unit, answered in zip(self._plan.sync_units, valid, strict=True)
            if not answered and not unit.optional
            for position in unit.devices
        ]

    def _out_of_op(self) -> StateError | None:
        """Query the devices. Return the error if a required one left OP or lost its address."""
        log, requires = self.log(), self._exchange.watch.requires
        found = self._exchange.query_states()
        required = [a for a in found.answers if requires(a.station.position)]
        error = state_error(required, log, found.other_masters)
        if error is None and found.without_address:
            return address_error(found.without_address, self._engine.al_status, log)
        return error

    def _axis_error(
        self, stops: Sequence[StoppedAxis], *, raise_faults: bool
    ) -> CatenaryError | None:
        """Return the error for required axes in fault or stopped without a request; stop all axes.

        Return None if there are none, or if the policy only reports them. If a device may be out of
        OP during a fault, query the devices first, and return that error without a stop.
        """
        requires = self._exchange.watch.requires
        states = map(state_of, self._views.statusword.tolist())
        in_fault = [axis for axis, state in enumerate(states) if state in IN_FAULT]
        faulty = [axis for axis in in_fault if requires(self._plan.axes[axis].device)]
        stops = [stop for stop in stops if requires(stop.device)]
        if raise_faults and faulty:
            cause = self._out_of_op() if self._engine.al_status != AlState.OP else None
            return cause or self.drive_error(faulty, "in fault")
        if raise_faults:
            for reason, what in RAISED.items():
                axes = [stop.axis for stop in stops if stop.reason is reason]
                if axes:
                    return self.drive_error(axes, what)
        unasked = [stop for stop in stops if stop.reason in UNASKED]
        if not unasked or self._policy.on_axis_stopped == "event":
            return None
        log = self.log()
        self.stop_axes()
        return stopped_error(unasked, self._plan, log)

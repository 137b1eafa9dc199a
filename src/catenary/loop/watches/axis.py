"""Watch of axes: new stops by the core, and mode changes that drives refused."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from catenary.bus import SubDevice
from catenary.bus.event_types import AxisStopped, ModeRefused
from catenary.core import AXIS_MODE_REFUSED, REQUEST_ENABLED
from catenary.plan.cycle import AxisPlan
from catenary.plan.request import Views
from catenary.plan.stop_reason import StopReason
from catenary.wire.cia402 import Mode


class StoppedAxis(NamedTuple):
    """Stop of an axis by the core."""

    axis: int  # number in the plan
    name: str
    device: int
    mode: int  # mode of operation that the drive reports; the planned one if it reports 0
    reason: StopReason
    cycle: int
    requested: bool  # True if the application or the loop requested it
    stopper: int = 0  # process of the operator that requested it; 0 if unknown

    @property
    def message(self) -> str:
        """Axis, cycle and reason, as text."""
        return f"{self.name} was stopped in cycle {self.cycle}: {self.cause}"

    @property
    def cause(self) -> str:
        """Reason, and the process of the operator if it is known, as text."""
        by_operator = self.reason is StopReason.OPERATOR and self.stopper
        return self.reason.text + (f" (process {self.stopper})" if by_operator else "")

    def event(self, now: float, sub: SubDevice) -> AxisStopped:
        """Return the event of the stop.

        Args:
            now: Present time [s].
            sub: Device of the axis.
        """
        return AxisStopped(now, sub, self.message, self.name, self.reason, self.cycle)


class RefusedMode(NamedTuple):
    """Mode change that a drive refused."""

    axis: int
    name: str
    device: int
    mode: int  # requested mode of operation

    def event(self, now: float, sub: SubDevice) -> ModeRefused:
        """Return the event of the refusal.

        Args:
            now: Present time [s].
            sub: Device of the axis.
        """
        message = (
            f"{self.name} did not change to {mode_name(self.mode)} (0x6061); it continues in its "
            "former mode"
        )
        return ModeRefused(now, sub, message, self.name, self.mode)


class AxisWatch:
    """Watch of the axes. It remembers the stops and refused modes already returned."""

    def __init__(
        self, views: Views, axes: Sequence[AxisPlan], stopper: Callable[[], int] = lambda: 0
    ) -> None:
        """Make a watch of axes.

        Args:
            views: Values of the axes.
            axes: Plans of the axes.
            stopper: Returns the process that last requested a stop; 0 if unknown.
        """
        self._views = views
        self._stopper = stopper
        self._axes = axes
        self._reasons = views.stop_reason.copy()
        self._cycles = views.stop_cycle.copy()
        self._refused = np.zeros(len(axes), np.bool_)

    def new_stops(self) -> list[StoppedAxis]:
        """Return the stops since the last call, in the order of the axes."""
        reasons, cycles = self._views.stop_reason.copy(), self._views.stop_cycle.copy()
        changed = (reasons != self._reasons) | (cycles != self._cycles)
        self._reasons, self._cycles = reasons, cycles
        return [self._stop(axis) for axis in np.flatnonzero(changed & (reasons != 0)).tolist()]

    def new_refusals(self, *, explained: bool) -> list[RefusedMode]:
        """Return the mode changes that were refused since the last call.

        Args:
            explained: False if only a refused mode can have caused the call. If no refusal is new,
                the application has then repeated a request, and all refusals are returned again.
        """
        flagged = (self._views.axis_flags & AXIS_MODE_REFUSED) != 0
        new = flagged & ~self._refused
        self._refused = flagged
        if not explained and not new.any():
            new = flagged
        return [self._refusal(axis) for axis in np.flatnonzero(new).tolist()]

    def _stop(self, axis: int) -> StoppedAxis:
        plan, reason = self._axes[axis], StopReason(self._views.stop_reason.item(axis))
        by_request = self._views.requested_state.item(axis) != REQUEST_ENABLED
        return StoppedAxis(
            axis,
            plan.name,
            plan.device,
            self._views.mode_actual.item(axis) or plan.mode,
            reason,
            self._views.stop_cycle.item(axis),
            requested=reason is StopReason.STOP_REQUEST and by_request,
            stopper=self._stopper() if reason is StopReason.OPERATOR else 0,
        )

    def _refusal(self, axis: int) -> RefusedMode:
        plan = self._axes[axis]
        return RefusedMode(axis, plan.name, plan.device, self._views.mode_target.item(axis))


def mode_name(mode: int) -> str:
    """Return the name of a mode of operation, or its number."""
    try:
        return Mode(mode).name
    except ValueError:
        return str(mode)

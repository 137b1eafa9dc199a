"""Interface of moves to one axis: its values of this cycle, and the data of the next commit."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from catenary.drive.profile import Motion
from catenary.drive.state_machine import RequestedState
from catenary.drive.units import AxisUnits
from catenary.errors import MoveError
from catenary.plan.request import Views
from catenary.plan.stop_reason import StopReason
from catenary.wire.cia402 import IN_FAULT, AxisState, Mode

if TYPE_CHECKING:
    from catenary.bus import Pending

Steps: TypeAlias = Generator[None, None, None]  # one step before each commit
WriteObject: TypeAlias = "Callable[[int, int], Pending[None]]"  # (object of slot 0, value)
PutRate: TypeAlias = Callable[[str, float], bool]  # False: not in the process data

FOLLOWED = 1  # axis_flags
REQUESTED_SHIFT = 6
JUMPS = 3  # counts per exchange of an estimated velocity that are not motion


class AxisFacts(NamedTuple):
    """Values of an axis that do not change while the loop is open."""

    name: str
    units: AxisUnits
    period: float  # [s] of the loop
    exchange: float  # [s] between two exchanges of its device
    measures_velocity: bool  # False: the velocity is estimated

    @property
    def standstill(self) -> float:
        """Largest velocity of an axis at rest.

        An estimated velocity jumps by a count per exchange while the axis stands.
        """
        jump = JUMPS * abs(self.units.position_scale) / self.exchange
        least = self.units.defaults.standstill
        return least if self.measures_velocity else max(least, jump)


class AxisPort:
    """Owns the data that a move writes to one axis: target, mode, and bits of the controlword."""

    def __init__(
        self,
        views: Views,
        index: int,
        facts: AxisFacts,
        *,
        write: WriteObject,
        put_rate: PutRate,
    ) -> None:
        self._views = views
        self._index = index
        self.name = facts.name
        self.units = facts.units
        self.exchange = facts.exchange  # [s] between two exchanges of its device
        self.period = facts.period  # [s] of the loop
        self._standstill = facts.standstill
        self.write_object = write
        self.put_rate = put_rate
        self.now = 0.0  # [s] time of the cycle
        self.motion: Motion | None = None  # last command of a profile of ours
        self.handshake = False  # a set-point of PP is being handed over
        self.handed_over: float | None = None  # the last set-point that PP acknowledged
        self.written: dict[str, int] = {}  # profile objects that were written by SDO

    @property
    def status(self) -> int:
        return self._views.statusword.item(self._index)

    @property
    def mode(self) -> int:
        return self._views.mode_actual.item(self._index)

    @property
    def requested_mode(self) -> int:
        return self._views.mode_target.item(self._index)

    @property
    def position(self) -> float:
        return self._views.actual_position.item(self._index)

    @property
    def velocity(self) -> float:
        return self._views.actual_velocity.item(self._index)

    @property
    def target(self) -> float:
        return self._views.target_position.item(self._index)

    @property
    def rest(self) -> float:
        """Position from which the axis moves on: its target.

        In PP, a target that the drive has not received is ignored: then the actual position.
        """
        if self.requested_mode == Mode.PP and self.target != self.handed_over:
            return self.position
        return self.target

    @property
    def followed(self) -> bool:
        """True if the axis follows its targets."""
        return bool(self._views.axis_flags.item(self._index) & FOLLOWED)

    @property
    def at_rest(self) -> bool:
        """True if the velocity is below the standstill, or too small to be measured."""
        return not abs(self.velocity) > self._standstill

    def set_target(self, position: float) -> None:
        self._views.target_position[self._index] = position

    def command(self, motion: Motion) -> None:
        """Send a motion as the set-point of CSP."""
        self.motion = motion
        self.set_target(motion.position)

    def request_mode(self, mode: int) -> None:
        self._views.mode_target[self._index] = mode

    def set_bits(self, bits: int) -> None:
        self._views.controlword_bits[self._index] |= bits

    def clear_bits(self, bits: int) -> None:
        self._views.controlword_bits[self._index] &= ~bits & 0xFFFF

    def has_bits(self, bits: int) -> bool:
        """Return True if the statusword of the drive has all of these bits."""
        return self.status & bits == bits

    @property
    def is_led(self) -> bool:
        """True if a law or a stream sets the targets."""
        return self._views.is_led()

    def stop_cause(self) -> str | None:
        """Return the reason why the axis cannot continue a move; None if it can."""
        views, i = self._views, self._index
        if views.axis_state.item(i) in IN_FAULT:
            return "the drive is in fault"
        if views.axis_flags.item(i) >> REQUESTED_SHIFT == RequestedState.ENABLED:
            return None
        reason = StopReason(views.stop_reason.item(i))
        return reason.text if reason else "it was disabled or stopped on request"

    def state_text(self) -> str:
        """Return the CiA 402 state, for messages."""
        try:
            return AxisState(self._views.axis_state.item(self._index)).name
        except ValueError:
            return "no CiA 402 state"

    def error(self, complaint: Complaint) -> MoveError:
        """Return the error of a move of this axis that does not reach its goal."""
        remaining = complaint.goal - self.position
        unit = self.units.names.position
        left = "" if math.isnan(remaining) else f", {remaining:.4g} {unit} before its goal"
        return MoveError(
            f"{self.name} {complaint.what}{left}",
            axis=self.name,
            remaining=remaining,
            hint=complaint.hint,
        )


class Complaint(NamedTuple):
    """Text of a MoveError: what the axis did, and what to do."""

    what: str
    hint: str
    goal: float = math.nan


def await_condition(
    port: AxisPort, met: Callable[[], bool], timeout: float, complaint: Complaint
) -> Steps:
    """Step until a condition is met.

    Raises:
        MoveError: It is not met after `timeout` [s].
    """
    begun = port.now
    while not met():
        if port.now - begun > timeout:
            raise port.error(complaint)
        yield


def mode_is(port: AxisPort, mode: int) -> Callable[[], bool]:
    """Return the condition that the drive works in a mode."""
    return lambda: port.mode == Mode(mode) and port.followed

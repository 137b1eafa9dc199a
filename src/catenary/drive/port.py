"""Interface of moves to one axis: values of the present cycle, and data for the next commit."""

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

Steps: TypeAlias = Generator[None, None, None]  # runs one step before each commit
WriteObject: TypeAlias = "Callable[[int, int], Pending[None]]"  # (index in slot 0, value)
PutRate: TypeAlias = Callable[[str, float], bool]  # returns False if the rate is not mapped

FOLLOWED = 1  # bit of axis_flags
REQUESTED_SHIFT = 6  # position of the requested state in axis_flags
JUMPS = 3  # noise of an estimated velocity at standstill [counts per exchange]


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

        An estimated velocity changes by some counts per exchange although the axis is at rest.
        """
        jump = JUMPS * abs(self.units.position_scale) / self.exchange
        least = self.units.defaults.standstill
        return least if self.measures_velocity else max(least, jump)


class AxisPort:
    """Owner of the data that a move writes to one axis: target, mode, bits of the controlword."""

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
        self.motion: Motion | None = None  # last command of the present profile
        self.handshake = False  # True while a set-point of PP is being handed over
        self.handed_over: float | None = None  # the last set-point that PP acknowledged
        self.written: dict[str, int] = {}  # profile objects that were written by SDO

    @property
    def status(self) -> int:
        """Statusword of the drive."""
        return self._views.statusword.item(self._index)

    @property
    def mode(self) -> int:
        """Mode that the drive reports (0x6061)."""
        return self._views.mode_actual.item(self._index)

    @property
    def requested_mode(self) -> int:
        """Mode that was requested from the drive (0x6060)."""
        return self._views.mode_target.item(self._index)

    @property
    def position(self) -> float:
        """Actual position."""
        return self._views.actual_position.item(self._index)

    @property
    def velocity(self) -> float:
        """Actual velocity."""
        return self._views.actual_velocity.item(self._index)

    @property
    def target(self) -> float:
        """Target position."""
        return self._views.target_position.item(self._index)

    @property
    def rest(self) -> float:
        """Position from which the next move starts, normally the target.

        In PP, it is the actual position if the drive has not received the target.
        """
        if self.requested_mode == Mode.PP and self.target != self.handed_over:
            return self.position
        return self.target

    @property
    def followed(self) -> bool:
        """True if the axis follows its targets."""
        return bool(self._views.axis_flags.item(self._index) & FOLLOWED)

    @property
    def jogged(self) -> bool:
        """True if an operator moves the axis."""
        return bool(self._views.jogged.item(self._index))

    @property
    def at_rest(self) -> bool:
        """True if the velocity is below that of a standstill, or too small to be measured."""
        return not abs(self.velocity) > self._standstill

    def set_target(self, position: float) -> None:
        """Write the target position."""
        self._views.target_position[self._index] = position

    def command(self, motion: Motion) -> None:
        """Write a motion as the CSP set-point."""
        self.motion = motion
        self.set_target(motion.position)

    def request_mode(self, mode: int) -> None:
        """Request a mode of operation."""
        self._views.mode_target[self._index] = mode

    def set_bits(self, bits: int) -> None:
        """Set bits of the controlword."""
        self._views.controlword_bits[self._index] |= bits

    def clear_bits(self, bits: int) -> None:
        """Clear bits of the controlword."""
        self._views.controlword_bits[self._index] &= ~bits & 0xFFFF

    def has_bits(self, bits: int) -> bool:
        """Return True if all of these bits are set in the statusword."""
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
        if views.jogged.item(i):
            return "an operator jogs the axis"
        if views.axis_flags.item(i) >> REQUESTED_SHIFT == RequestedState.ENABLED:
            return None
        reason = StopReason(views.stop_reason.item(i))
        return reason.text if reason else "it was disabled or stopped on request"

    def state_text(self) -> str:
        """Return the name of the CiA 402 state, for messages."""
        try:
            return AxisState(self._views.axis_state.item(self._index)).name
        except ValueError:
            return "unknown CiA 402 state"

    def error(self, failure: Failure) -> MoveError:
        """Return the error of a move that does not reach its goal."""
        remaining = failure.goal - self.position
        unit = self.units.names.position
        left = "" if math.isnan(remaining) else f", {abs(remaining):.4g} {unit} from its goal"
        return MoveError(
            f"{self.name} {failure.what}{left}",
            axis=self.name,
            remaining=remaining,
            hint=failure.hint,
        )


class Failure(NamedTuple):
    """Text of a MoveError."""

    what: str  # what the axis did or did not do, as a predicate
    hint: str
    goal: float = math.nan  # NaN for a homing


def await_condition(
    port: AxisPort, met: Callable[[], bool], timeout: float, failure: Failure
) -> Steps:
    """Wait until a condition is met.

    Args:
        port: the axis.
        met: the condition.
        timeout: longest wait [s].
        failure: text of the error.

    Raises:
        MoveError: The condition is not met in time.
    """
    begun = port.now
    while not met():
        if port.now - begun > timeout:
            raise port.error(failure)
        yield


def mode_is(port: AxisPort, mode: int) -> Callable[[], bool]:
    """Return the condition that the drive is in a mode and follows its targets."""
    return lambda: port.mode == Mode(mode) and port.followed

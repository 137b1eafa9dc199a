"""Jogs and requested states: motions of single axes on request of an operator in another process.

The core of the loop generates the motion (native/motion.h). A jog continues only while its
heartbeats echo recent tokens. This works in every execution mode, also while a law runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import IntEnum
from types import TracebackType
from typing import Literal, TypeVar

from catenary.share.command_table import MotionWords
from catenary.share.sweep import Sweep

STATUS_BITS = 8
TOKEN_MASK = (1 << 48) - 1
PRESS_SHIFT, PRESS_MASK = 48, 0xFFFF
NUMBER_MASK = (1 << 56) - 1

S = TypeVar("S", bound=IntEnum)
State = Literal["disable", "enable", "quick_stop", "reset"]
STATES: dict[str, int] = {"disable": 0, "enable": 1, "quick_stop": 2, "reset": 3}


class JogStatus(IntEnum):
    """Status of a jog. The core uses the same numbers."""

    NONE = 0  # the core has not seen the press yet
    MOVING = 1
    STOPPING = 2
    DONE = 3
    RELEASED = 4
    EXPIRED = 5
    AT_LIMIT = 6
    ENDED_STOPPED = 7
    REPLACED = 8
    REFUSED_NOT_ALLOWED = 16
    REFUSED_NOT_ENABLED = 17
    REFUSED_MODE = 18
    REFUSED_MOVING = 19
    REFUSED_STALE = 20
    REFUSED_INVALID = 21

    @property
    def text(self) -> str:
        """Description of the status, for messages."""
        return JOG_TEXTS[self]

    @property
    def over(self) -> bool:
        """True if the jog has ended or was refused."""
        return self >= JogStatus.DONE

    @property
    def refused(self) -> bool:
        """True if the jog was refused, so that the axis has not moved."""
        return self >= JogStatus.REFUSED_NOT_ALLOWED


JOG_TEXTS: dict[JogStatus, str] = {
    JogStatus.NONE: "requested",
    JogStatus.MOVING: "moving",
    JogStatus.STOPPING: "stopping",
    JogStatus.DONE: "the motion is complete",
    JogStatus.RELEASED: "released",
    JogStatus.EXPIRED: "stopped: no fresh heartbeat within 200 ms",
    JogStatus.AT_LIMIT: "stopped at a position limit",
    JogStatus.ENDED_STOPPED: "ended: the axis was stopped or disabled",
    JogStatus.REPLACED: "ended: the axis received another jog",
    JogStatus.REFUSED_NOT_ALLOWED: "refused: the program does not allow jogs",
    JogStatus.REFUSED_NOT_ENABLED: "refused: the axis is not enabled",
    JogStatus.REFUSED_MODE: "refused: a jog needs mode csp, csv or pv",
    JogStatus.REFUSED_MOVING: "refused: the program moves the axis",
    JogStatus.REFUSED_STALE: "refused: the request is older than 200 ms",
    JogStatus.REFUSED_INVALID: "refused: a value of the request is not valid",
}


class RequestStatus(IntEnum):
    """Status of a requested state of an axis. The core uses the same numbers."""

    PENDING = 0
    TAKEN = 1
    REFUSED_NOT_ALLOWED = 16
    REFUSED_MODE = 18
    REFUSED_INVALID = 21
    REFUSED_LOST = 22
    REFUSED_HANDOVER = 23

    @property
    def text(self) -> str:
        """Description of the status, for messages."""
        return REQUEST_TEXTS[self]


REQUEST_TEXTS: dict[RequestStatus, str] = {
    RequestStatus.PENDING: "requested",
    RequestStatus.TAKEN: "taken",
    RequestStatus.REFUSED_NOT_ALLOWED: "refused: the program does not allow it",
    RequestStatus.REFUSED_MODE: "refused: the program must enable an axis in this mode",
    RequestStatus.REFUSED_INVALID: "refused: the requested state is not valid",
    RequestStatus.REFUSED_LOST: "refused: the device does not answer",
    RequestStatus.REFUSED_HANDOVER: "refused: the program starts, ends or waits",
}


class Jog:
    """Motion of one axis on request of an operator. `Lease.jog` creates it.

    The axis moves until `release`, or until its distance or its sweep is complete. It stops
    200 ms after the issue of the token that the last heartbeat has echoed.

        with cat.attach("arm") as arm, arm.lease(axes=["1 Servo"]) as command:
            with command.jog("1 Servo", 0.1) as jog:
                while button_is_pressed():
                    jog.beat()
                    time.sleep(0.05)
    """

    def __init__(
        self, words: MotionWords, number: int, press: int, renew: Callable[[], None], axis: str
    ) -> None:
        self.axis = axis  # its name
        self.press = press  # number of the press
        self._words = words
        self._number = number
        self._renew = renew

    def beat(self, token: int | None = None) -> None:
        """Extend the jog until 200 ms after the issue of a token, and renew the lease.

        Call it at least every 100 ms. An unknown or old token extends nothing.

        Args:
            token: the token that the operator's device has echoed; None: the newest token, for a
                program on this machine.

        Raises:
            LeaseError: the lease has ended, or the desk is locked for too long.
            ValueError: the token does not have 48 bits.
        """
        echoed = heartbeat_of(self._words, self.press, token)
        self._renew()
        self._words.heartbeat.store(self._number, echoed)

    def release(self) -> None:
        """Stop the axis with its deceleration. A no-op after another jog of the axis."""
        if self._words.press.load(self._number) == self.press:
            self._words.released.store(self._number, self.press)

    @property
    def status(self) -> JogStatus:
        """Status of the jog, at the last cycle."""
        answer = self._words.answer.load(self._number)
        press = answer >> STATUS_BITS
        if press != self.press:
            return JogStatus.REPLACED if press > self.press else JogStatus.NONE
        return status_of(JogStatus, answer, JogStatus.NONE)

    def __enter__(self) -> Jog:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.release()

    def __repr__(self) -> str:
        return f"<Jog of {self.axis}: {self.status.text}>"


class StateRequest:
    """Handle of a requested state of some axes. `Lease.request` creates it."""

    def __init__(self, words: MotionWords, numbers: dict[int, int]) -> None:
        self._words = words
        self._numbers = numbers  # axis → number of the request

    @property
    def status(self) -> tuple[RequestStatus, ...]:
        """Status of the request of each axis.

        A later request of the axis counts as TAKEN, because it replaces this one.
        """
        return tuple(self._status(axis, number) for axis, number in self._numbers.items())

    def _status(self, axis: int, number: int) -> RequestStatus:
        taken = self._words.taken.load(axis)
        if taken >> STATUS_BITS < number:
            return RequestStatus.PENDING
        if taken >> STATUS_BITS > number:
            return RequestStatus.TAKEN
        return status_of(RequestStatus, taken, RequestStatus.PENDING)


def status_of(kind: type[S], word: int, unknown: S) -> S:
    """Return the status in the low byte of an answer.

    Args:
        kind: the enumeration.
        word: the answer.
        unknown: result for a number without a name.
    """
    number = word & ((1 << STATUS_BITS) - 1)
    return kind(number) if number in tuple(kind) else unknown


def heartbeat_of(words: MotionWords, press: int, token: int | None) -> int:
    """Return the heartbeat word of a press: the token, with the low bits of the press above it.

    Args:
        words: motion words of the desk.
        press: number of the press.
        token: echoed token; None: the newest token.

    Raises:
        ValueError: the token does not have 48 bits.
    """
    echoed = words.token.load(0) if token is None else token
    if not 0 <= echoed <= TOKEN_MASK:
        raise ValueError(f"token={echoed}: must be a number of 48 bits")
    return echoed | (press & PRESS_MASK) << PRESS_SHIFT


def checked_values(
    velocity: float, distance: float | None, acceleration: float | None, sweep: Sweep | None
) -> dict[str, float]:
    """Return the values of a jog for the fields of its slot.

    Args:
        velocity: signed velocity [rad/s or m/s].
        distance: distance [rad or m].
        acceleration: acceleration [rad/s² or m/s²].
        sweep: sine whose amplitude is the velocity.

    Raises:
        ValueError: a value is not finite, the velocity is 0, another value is not positive, or a
            sweep has a distance.
    """
    if not math.isfinite(velocity) or velocity == 0:
        raise ValueError(f"velocity={velocity}: must be finite and not 0")
    for name, value in (("distance", distance), ("acceleration", acceleration)):
        if value is not None and not 0 < value < math.inf:
            raise ValueError(f"{name}={value}: must be positive and finite")
    if sweep is not None and distance is not None:
        raise ValueError(f"distance={distance}: must be None for a sweep")
    return {
        "velocity": float(velocity),
        "distance": math.nan if distance is None else float(distance),
        "acceleration": math.nan if acceleration is None else float(acceleration),
        "sweep_start": 0.0 if sweep is None else sweep.start,
        "sweep_end": 0.0 if sweep is None else sweep.end,
        "sweep_duration": 0.0 if sweep is None else sweep.duration,
    }


def press(words: MotionWords, axis: int, values: Mapping[str, float], token: int | None) -> int:
    """Publish a new press, and return its number. The caller holds the mutex of the desk.

    Args:
        words: motion words of the desk.
        axis: number of the axis.
        values: values of the fields of the slot: see `checked_values`.
        token: echoed token; None: the newest token.

    Raises:
        ValueError: the token does not have 48 bits.
    """
    number = (max(words.press.load(axis), words.begun.load(axis)) + 1) & NUMBER_MASK
    echoed = heartbeat_of(words, number, token)
    words.begun.store(axis, number)
    slot = words.slots[axis]
    for field, value in values.items():
        slot[field] = value
    words.heartbeat.store(axis, echoed)
    words.press.store(axis, number)
    return number


def request_state(words: MotionWords, axis: int, state: int) -> int:
    """Publish a requested state, and return the number of the request.

    The caller holds the mutex of the desk.

    Args:
        words: motion words of the desk.
        axis: number of the axis.
        state: code of the requested state.
    """
    number = ((words.request.load(axis) >> STATUS_BITS) + 1) & NUMBER_MASK
    words.request.store(axis, number << STATUS_BITS | state)
    return number

"""States of one device: requests, reports, errors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from catenary.capture.contents import (
    Content,
    DeviceSilent,
    StateReached,
    StateRefused,
    StateRequest,
)
from catenary.capture.events import Step, step_of
from catenary.capture.transaction import Transaction
from catenary.errors import DecodeError
from catenary.wire.al import AlControl, AlState, AlStatus
from catenary.wire.register import AL_CONTROL, AL_STATUS, AL_STATUS_CODE


class Found(NamedTuple):
    """A content with its step."""

    step: Step
    content: Content


class StateFollower:
    """Owner of the known state and the requested state of one device."""

    def __init__(self) -> None:
        self.state: AlState | None = None
        self.requested: AlState | None = None
        self._acknowledged = False  # by the last request
        self._requested_ns = 0
        self._status: AlStatus | None = None
        self._before_error: AlState | None = None
        self._error_open = False  # the status code was not read yet
        self._silent = False

    def step(self, *, configures: bool = False) -> Step:
        """Return the step of an event at this moment.

        Args:
            configures: True for a register that prepares the next transition.
        """
        return step_of(self.state, self.requested, configures=configures)

    def follow(self, each: Transaction) -> Iterator[Found]:
        """Follow a datagram to this device."""
        if each.ado > AL_STATUS_CODE.address:
            return
        if (control := each.was_written(AL_CONTROL)) is not None:
            yield from self._request(each, control)
        if each.command.reads and not each.command.writes:
            yield from self._answers(each)
        if (status := each.was_read(AL_STATUS)) is not None:
            code = each.was_read(AL_STATUS_CODE)
            yield from self._report(each.time_ns, status, code)
        elif (code := each.was_read(AL_STATUS_CODE)) is not None and self._error_open:
            yield self._refusal(int.from_bytes(code, "little"))

    def inherit(self, other: StateFollower) -> None:
        """Begin with the state and the request of broadcasts before this device was known."""
        self.state, self._status = other.state, other._status
        self.requested, self._requested_ns = other.requested, other._requested_ns
        self._acknowledged = other._acknowledged

    def set_requested(self, control: AlControl, time_ns: int) -> None:
        """Store a request, also one by a broadcast."""
        self.requested, self._requested_ns = control.state, time_ns
        self._acknowledged = control.acknowledge

    def set_state(self, state: AlState, time_ns: int) -> StateReached | None:
        """Store a state without an error. Return its event if the state has changed."""
        self._error_open = False
        self._status = AlStatus(state)
        if self.state is state:
            return None
        self.state = state
        after = time_ns - self._requested_ns if self.requested is state else None
        return StateReached(state, after)

    def flush(self) -> Iterator[Found]:
        """Yield an error without its status code, because the master did not read it."""
        if self._error_open:
            yield self._refusal(None)

    def _request(self, each: Transaction, data: bytes) -> Iterator[Found]:
        control = decode_control(data)
        if control is None:
            return
        yield from self.flush()
        if each.accepted:
            self.set_requested(control, each.time_ns)
        step = step_of(self.state, control.state)
        yield Found(step, StateRequest(control.state, control.acknowledge, each.accepted))

    def _answers(self, each: Transaction) -> Iterator[Found]:
        if each.ado != AL_STATUS.address or each.working_counter is None:
            return
        silent = each.working_counter == 0
        if silent is not self._silent:
            self._silent = silent
            yield Found(self.step(), DeviceSilent(silent))

    def _report(self, time_ns: int, data: bytes, code: bytes | None) -> Iterator[Found]:
        try:
            status = AlStatus.from_word(int.from_bytes(data, "little"))
        except DecodeError:
            return
        if status.error and self._is_echo(status, code):
            status = AlStatus(status.state)
        if not status.error:
            yield from self.flush()
            before = self.state
            reached = self.set_state(status.state, time_ns)
            if reached:
                yield Found(Step(before or status.state, status.state), reached)
            return
        if status != self._status:
            yield from self.flush()
            self._before_error, self._error_open = self.state, True
            self._status, self.state = status, status.state
        if code is not None and self._error_open:
            yield self._refusal(int.from_bytes(code, "little"))

    def _is_echo(self, status: AlStatus, code: bytes | None) -> bool:
        """Return True if the error bit is the acknowledge bit of the request.

        A controller without a processor (device emulation) copies AL control to AL status.
        """
        return self._acknowledged and status.state is self.requested and not any(code or b"")

    def _refusal(self, code: int | None) -> Found:
        self._error_open = False
        state = self.state or AlState.INIT
        before = self._before_error
        refused = StateRefused(state, self.requested, code, before)
        step = Step(before, state) if refused.fell else step_of(state, self.requested)
        return Found(step, refused)


def decode_control(data: bytes) -> AlControl | None:
    """Return a request in AL control; None if it is invalid."""
    try:
        return AlControl.from_word(int.from_bytes(data, "little"))
    except DecodeError:
        return None

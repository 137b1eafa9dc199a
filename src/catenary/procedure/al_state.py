"""State changes of a device, ETG.1000.6 §5.3 and §6.4; times from ETG.1020 table "Timeouts"."""

from __future__ import annotations

from typing import NamedTuple

from catenary.errors import DecodeError, StateError
from catenary.procedure.exchange import Procedure, after, read_memory, write
from catenary.procedure.station import Deadline, Pace, Station, answered
from catenary.wire.al import AlControl, AlState, AlStatus, status_code
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import AL_CONTROL, AL_STATUS, AL_STATUS_CODE

# [s] by requested state; the defaults of the ESI (ETG.2000, StateMachine/Timeout).
TIMEOUTS = {
    AlState.INIT: 5.0,
    AlState.PRE_OP: 3.0,
    AlState.BOOT: 3.0,
    AlState.SAFE_OP: 10.0,
    AlState.OP: 10.0,
}

ACKNOWLEDGE_TIMEOUT = 0.5  # [s]
TAKE_TIMEOUT = 0.5  # [s]; applications read AL control every few milliseconds

_STATUS_START = AL_STATUS.address
_STATUS_SIZE = AL_STATUS_CODE.address + AL_STATUS_CODE.size - AL_STATUS.address


class DeviceState(NamedTuple):
    """AL status and its code, read together."""

    state: AlState | None  # None for a value that the standard does not define
    error: bool
    code: int
    word: int

    @property
    def name(self) -> str:
        """Name of the state; its number if the standard does not define it."""
        return str(self.state) if self.state is not None else f"state {self.word & 0xF}"


def read_state(station: Station) -> Procedure[DeviceState]:
    """Read the present state of a device."""
    [reply] = yield [read_memory(station.address, _STATUS_START, _STATUS_SIZE, repeatable=True)]
    return _decoded(answered(reply, station, "AL status"))


def request_state(
    station: Station, target: AlState, *, timeout: float | None = None
) -> Procedure[DeviceState]:
    """Request a state and wait until the device reaches it. A pending error is acknowledged first.

    Args:
        station: The device.
        target: The requested state.
        timeout: Time for the change [s]; None for the default of the state, or the time of the
            device's ESI if it is longer.

    Raises:
        StateError: The device refuses, takes too long, or does not clear a pending error. The
            exception contains the AL status code.
    """
    before = yield from read_state(station)
    if before.error:
        yield from acknowledge(station, before)
    elif before.state is target:
        return before
    yield from write_control(station, AlControl(target))
    return (yield from _await_state(station, target, timeout or state_timeout(station, target)))


def state_timeout(station: Station, target: AlState) -> float:
    """Return the timeout for a state [s]: the default, or that of the ESI if it is longer.

    Args:
        station: The device.
        target: The requested state.
    """
    given = station.timeouts
    stated = {
        AlState.INIT: given.back_to_init,
        AlState.PRE_OP: given.pre_op,
        AlState.BOOT: given.pre_op,  # ETG.2000, PreopTimeout: INIT to PRE-OP or BOOT
        AlState.SAFE_OP: given.safe_op_and_op,
        AlState.OP: given.safe_op_and_op,
    }
    return max(TIMEOUTS[target], stated.get(target) or 0.0)


def write_control(station: Station, control: AlControl) -> Procedure[None]:
    """Write AL control until the controller accepts it.

    A controller rejects AL control until its application has read the previous one (ET1100
    datasheet, register 0x0120).

    Args:
        station: The device.
        control: The requested state.

    Raises:
        StateError: The controller does not accept the request in time.
    """
    deadline, pace = Deadline(TAKE_TIMEOUT), Pace()
    while True:
        [taken, status] = yield [
            write(EcatCommand.FPWR, station.address, AL_CONTROL, control.word),
            read_memory(station.address, _STATUS_START, _STATUS_SIZE, repeatable=True),
        ]
        if not taken.lost and taken.working_counter == 1:
            return
        now = _decoded(answered(status, station, f"request for {control.state}"))
        if deadline.passed(status):
            raise _refused(
                station, control.state, now, f"does not accept the request for {control.state}"
            )
        yield after(pace.pause())


def acknowledge(station: Station, pending: DeviceState) -> Procedure[DeviceState]:
    """Acknowledge an AL error by requesting the present state. Return the new state.

    If the standard does not define the present state, INIT is requested.

    A controller with device emulation only copies AL control to AL status. Its error is then a copy
    of the acknowledgement, and a request without acknowledgement clears it.

    Args:
        station: The device.
        pending: State of the device, with the error.

    Raises:
        StateError: The error remains.
    """
    state = pending.state or AlState.INIT
    now = pending
    for control in (AlControl(state, acknowledge=True), AlControl(state)):
        yield from write_control(station, control)
        now = yield from _await_no_error(station, ACKNOWLEDGE_TIMEOUT)
        if not now.error:
            return now
    raise _refused(station, state, now, f"does not clear its error in {state}")


def _await_no_error(station: Station, timeout: float) -> Procedure[DeviceState]:
    deadline, pace = Deadline(timeout), Pace()
    while True:
        [reply] = yield [read_memory(station.address, _STATUS_START, _STATUS_SIZE, repeatable=True)]
        now = _decoded(answered(reply, station, "AL status"))
        if not now.error or deadline.passed(reply):
            return now
        yield after(pace.pause())


def _await_state(station: Station, target: AlState, timeout: float) -> Procedure[DeviceState]:
    deadline, pace = Deadline(timeout), Pace()
    while True:
        [reply] = yield [read_memory(station.address, _STATUS_START, _STATUS_SIZE, repeatable=True)]
        now = _decoded(answered(reply, station, "AL status"))
        if now.error:
            raise _refused(station, target, now, f"refused {target}")
        if now.state is target:
            return now
        if deadline.passed(reply):
            raise _refused(station, target, now, f"did not reach {target} within {timeout:g} s")
        yield after(pace.pause())


def _decoded(data: bytes) -> DeviceState:
    word = AL_STATUS.unpack(data[: AL_STATUS.size])
    code = AL_STATUS_CODE.unpack(data[-AL_STATUS_CODE.size :])
    try:
        status = AlStatus.from_word(word)
    except DecodeError:
        return DeviceState(None, bool(word & 0x10), code, word)
    return DeviceState(status.state, status.error, code, word)


def _refused(station: Station, target: AlState, now: DeviceState, what: str) -> StateError:
    known = status_code(now.code)
    reason = f", AL status code 0x{now.code:04X}: {known.text}" if now.code else ""
    return StateError(
        f"{station} {what}: it is in {now.name}{' with an error' * now.error}{reason}",
        position=station.position,
        requested=int(target),
        actual=now.word & 0x0F,
        code=now.code,
        hint=known.cause
        or "read its AL status again; its manual lists the requirements. If there is no "
        "error code, check for a second master that also requests states",
    )

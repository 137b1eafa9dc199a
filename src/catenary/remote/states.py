"""Methods that change the state of a device while the loop runs."""

from __future__ import annotations

from functools import partial

from catenary.bus import SubDevice
from catenary.errors import LoopError
from catenary.procedure.al_state import DeviceState, acknowledge, read_state, request_state
from catenary.procedure.exchange import Procedure, after
from catenary.procedure.station import Station
from catenary.remote import messages
from catenary.remote.program import Program, Work, checked
from catenary.wire.al import AlState, status_code

RETURN_PAUSE = 0.05  # [s] between two checks of a device that the loop brings to OP


def set_state(
    program: Program, position: int, state: str, force: bool = False
) -> Work[messages.State]:
    """Bring a device of the running loop to a state; see `Client.set_state`."""
    sub, target = program.device(position), AlState.from_name(state)
    if target is AlState.BOOT:
        raise ValueError("BOOT is not possible while a loop runs: close the loop first")
    if target is AlState.OP:
        program.session.watch.release(sub)
        return as_message((yield from program.ask(_until_op(sub.station))))
    refuse = partial(_refuse_powered, program, sub, f"the request for {target}")
    refuse()
    if program.session.watch.requires(position) and not force:
        raise LoopError(
            f"{sub.station} is required: the loop ends with StateError if it leaves OP",
            hint="use force=True to accept this, or make its request with required=False",
        )
    return as_message((yield from program.ask(checked(refuse, request_state(sub.station, target)))))


def reset_error(program: Program, position: int) -> Work[messages.State]:
    """Acknowledge the AL error of a device, which stays in its state."""
    station = program.device(position).station
    return as_message((yield from program.ask(_acknowledged(station))))


def as_message(found: DeviceState) -> messages.State:
    """Return a state as a message."""
    text = status_code(found.code).text if found.code else ""
    return messages.State(
        state=found.name, error=found.error, al_status_code=found.code, al_status_text=text
    )


def _until_op(station: Station) -> Procedure[DeviceState]:
    """Wait until the loop has brought a device to OP. The deadline of the request ends the wait."""
    while True:
        found = yield from read_state(station)
        if found.state is AlState.OP:
            return found
        yield after(RETURN_PAUSE)


def _acknowledged(station: Station) -> Procedure[DeviceState]:
    found = yield from read_state(station)
    return (yield from acknowledge(station, found)) if found.error else found


def _refuse_powered(program: Program, sub: SubDevice, what: str) -> None:
    """Raise LoopError if an axis of the device is enabled, or still brakes."""
    enabled = program.powered_axes(sub.position)
    if enabled:
        raise LoopError(
            f"{what} is refused: {', '.join(enabled)} of {sub.station} enabled",
            hint="disable the axis first",
        )

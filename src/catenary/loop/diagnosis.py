"""From a cycle that went wrong to an error that names the device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from catenary.errors import DriveError, StateError, WorkingCounterError
from catenary.log import Log
from catenary.model.finding import Finding
from catenary.procedure.survey import Answer
from catenary.wire.al import ERROR_FLAG, STATE_MASK, State, status_code
from catenary.wire.cia402 import IN_FAULT
from catenary.wire.cia402 import State as DriveState
from catenary.wire.drive_error import error_text


def silence_error(
    answers: Sequence[Answer],
    suspects: Sequence[int],
    lost: int,
    log: Log | None,
    findings: Sequence[Finding] = (),
    mute: Sequence[int] = (),
    tight: str = "",
) -> WorkingCounterError:
    """Return the error for `lost` bad cycles in a row.

    Args:
        answers: of all devices to a read of their AL status.
        suspects: devices of the units that failed.
        lost: number of cycles.
        log: the last cycles.
        findings: places that silent devices or error counters point to.
        mute: devices whose inputs are missing even in a frame of their own.
        tight: hint that the period is perhaps too short; or empty.
    """
    silent = [answer.station for answer in answers if answer.word is None]
    others = [a for a in answers if a.station.position in suspects and a.word is not None]
    stray = [answer for answer in others if is_astray(answer)]
    if silent and len(silent) == len(answers):
        who, hint = "no device answers", "check the cable and power of the first device"
    elif silent:
        who = f"silent: {', '.join(map(str, silent))}"
        places = "; ".join(finding.where for finding in findings) or "the cable before it"
        hint = f"look at {places}"
    elif stray:
        who = f"not in OP: {'; '.join(map(described, stray))}"
        hint = "a device that was switched off and on again must be brought up again"
    elif mute:
        named = ", ".join(str(a.station) for a in answers if a.station.position in mute)
        who = f"in OP, but without process data: {named}"
        hint = (
            "its FMMU or SyncManager was switched off: by another program on this segment, or by "
            "itself; read its registers, catenary reg read"
        )
    else:
        who = f"all devices answer to single reads; affected: devices {listed(suspects)}"
        who += "".join(f"; {each.where}: {each.evidence}" for each in findings)
        hint = tight or (
            "frames are lost, corrupted or late on the way: check cables and other traffic on the "
            "port; where the segment is a program on a busy machine, allow it more cycles with "
            "StopPolicy(lost_limit=...)"
        )
    return WorkingCounterError(
        f"{lost} cycles in a row without all answers; {who}", log=log, hint=hint
    )


def tight_period(wire_ns: int, period_ns: int) -> str:
    """Return a hint if the cyclic frames take most of the period; else an empty text."""
    if 2 * wire_ns < period_ns:
        return ""
    return (
        f"the cyclic frames take {wire_ns / 1e3:g} us of the period of {period_ns / 1e3:g} us at "
        "100 Mbit/s, and every device delays them by about 1 us: use a longer period"
    )


def state_error(
    answers: Sequence[Answer], log: Log | None, other_masters: Sequence[str] = ()
) -> StateError | None:
    """Return the error for devices that left OP; None if all are there. `other_masters`: evidence
    of another master, as text."""
    astray = [answer for answer in answers if is_astray(answer)]
    if not astray:
        return None
    first = astray[0]
    known = status_code(first.code)
    error = StateError(
        f"{described(first)}, out of OP",
        position=first.station.position,
        requested=int(State.OP),
        actual=(first.word or 0) & STATE_MASK,
        code=first.code,
        log=log,
        hint=_suspicion(first, other_masters) or known.cause or "see its manual",
    )
    for other in astray[1:]:
        error.add_note(f"also: {described(other)}")
    return error


def _suspicion(answer: Answer, other_masters: Sequence[str]) -> str:
    """Return what points to another master; a device that leaves OP by itself gives a reason."""
    if other_masters:
        return f"another EtherCAT master is live: {'; '.join(other_masters)}; end it"
    if answer.code or (answer.word or 0) & ERROR_FLAG:
        return ""
    return (
        "it gives no reason, so its state was probably requested: look for a second master on this "
        "line, or in another container; a device that was switched off and on shows INIT, too"
    )


def forgetful_error(silent: Sequence[Answer], al_status: int, log: Log | None) -> StateError:
    """The error for devices that lost their addresses while all frames come back: they were off for
    a moment. `al_status`: the OR of all states."""
    first = silent[0]
    error = StateError(
        f"{first.station} does not answer to its address any more, while not all that answer are "
        f"in OP (AL status 0x{al_status:02X}, all together)",
        position=first.station.position,
        requested=int(State.OP),
        actual=int(State.INIT),
        code=0,
        log=log,
        hint="it was switched off and on for less time than the loop endures lost frames, or "
        "exchanged: look at its supply; a new scan() and Loop bring it up again",
    )
    for other in silent[1:]:
        error.add_note(f"also: {other.station}")
    return error


class AxisTrouble(NamedTuple):
    """One axis and what it says about itself."""

    name: str
    state: DriveState | None
    code: int | None  # object 0x603F; None: it could not be read

    def __str__(self) -> str:
        state = self.state.name if self.state is not None else "in no state of CiA 402"
        if self.code is None:
            return f"{self.name}: {state}, its error code cannot be read"
        return f"{self.name}: {state}, error code 0x{self.code:04X} ({error_text(self.code)})"


def drive_error(axes: Sequence[AxisTrouble], what: str, log: Log | None) -> DriveError:
    """The error for axes of which `what` is to be said: "in fault", "cannot be enabled"."""
    faulty = any(axis.state in IN_FAULT for axis in axes)
    hint = (
        "remove the cause, then open a new Loop: it resets the fault. To stay in this one, use "
        "StopPolicy(raise_faults=False) and Drives.enable()"
        if faulty
        else "check its main supply, safe torque off and the enable input"
    )
    return DriveError(f"{what}: {'; '.join(map(str, axes))}", log=log, hint=hint)


def is_astray(answer: Answer) -> bool:
    """Answers, but not from OP."""
    return answer.word is not None and answer.word & (STATE_MASK | ERROR_FLAG) != State.OP


def described(answer: Answer) -> str:
    """The device, its state and its reason."""
    assert answer.word is not None
    try:
        state = str(State(answer.word & STATE_MASK))
    except ValueError:
        state = f"state {answer.word & STATE_MASK}"
    error = " with an error" if answer.word & ERROR_FLAG else ""
    reason = (
        f" (AL status code 0x{answer.code:04X}: {status_code(answer.code).text})"
        if answer.code
        else ""
    )
    return f"{answer.station} is in {state}{error}{reason}"


def listed(positions: Sequence[int]) -> str:
    return ", ".join(map(str, positions)) or "none"

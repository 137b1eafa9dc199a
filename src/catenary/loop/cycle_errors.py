"""Errors for bad cycles, with the devices that caused them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from catenary.errors import DriveError, StateError, WorkingCounterError
from catenary.log import Log
from catenary.model.finding import Finding
from catenary.procedure.al_status_poll import Answer
from catenary.wire.al import ERROR_FLAG, STATE_MASK, AlState, status_code
from catenary.wire.cia402 import IN_FAULT, AxisState
from catenary.wire.drive_error import error_text


@dataclass(frozen=True, slots=True)
class Evidence:
    """Answers of all devices to a read of the AL status, and further findings."""

    answers: Sequence[Answer]
    findings: Sequence[Finding] = ()  # faults that silent devices or error counters indicate
    mute: Sequence[int] = ()  # positions of devices that return no inputs, even in a separate frame
    tight: str = ""  # hint that the period may be too short; empty if not
    without_address: Sequence[Answer] = ()  # silent at their addresses while others answer
    other_masters: Sequence[str] = ()  # evidence of another master, as text


def silence_error(
    evidence: Evidence, suspects: Sequence[int], lost: int, log: Log | None
) -> WorkingCounterError:
    """Return the error for `lost` bad cycles in a row.

    Args:
        evidence: Answers of all devices, and further findings.
        suspects: Positions of the devices whose sync units failed.
        lost: Number of bad cycles.
        log: The last cycles.
    """
    answers, findings = evidence.answers, evidence.findings
    silent = [answer.station for answer in answers if answer.word is None]
    others = [a for a in answers if a.station.position in suspects and a.word is not None]
    stray = [answer for answer in others if is_astray(answer)]
    if silent and len(silent) == len(answers):
        who, hint = "no device answers", "check the cable and power of the first device"
    elif silent:
        who = f"silent: {', '.join(map(str, silent))}"
        places = "; ".join(finding.where for finding in findings) or "the cable before it"
        hint = f"check {places}"
    elif stray:
        who = f"not in OP: {'; '.join(map(described, stray))}"
        hint = "a device that was switched off and on again must be brought to OP again"
    elif evidence.mute:
        named = ", ".join(str(a.station) for a in answers if a.station.position in evidence.mute)
        who = f"in OP, but without process data: {named}"
        hint = (
            "another program on this segment, or the device itself, has switched off an FMMU or "
            "SyncManager; read the registers with `catenary reg read`"
        )
    else:
        who = f"all devices answer single reads; affected: devices {listed(suspects)}"
        who += "".join(f"; {each.where}: {each.evidence}" for each in findings)
        hint = evidence.tight or (
            "frames are lost, corrupted or late: check the cables and other traffic on the "
            "port; for a virtual segment on a busy machine, allow more lost cycles with "
            "StopPolicy(lost_limit=...)"
        )
    return WorkingCounterError(
        f"{lost} cycles in a row without all answers; {who}", log=log, hint=hint
    )


def tight_period(wire_ns: int, period_ns: int) -> str:
    """Return a hint if the cyclic frames take at least half of the period, otherwise "".

    Args:
        wire_ns: Wire time of the cyclic frames [ns].
        period_ns: Period of the cycle [ns].
    """
    if 2 * wire_ns < period_ns:
        return ""
    return (
        f"the cyclic frames take {wire_ns / 1e3:g} us of the period of {period_ns / 1e3:g} us at "
        "100 Mbit/s, and every device delays them by about 1 us: use a longer period"
    )


def state_error(
    answers: Sequence[Answer], log: Log | None, other_masters: Sequence[str] = ()
) -> StateError | None:
    """Return the error for devices that are out of OP or report an error; None if there are none.

    Devices that do not answer are ignored.

    Args:
        answers: Answers of the devices to a read of the AL status.
        log: The last cycles.
        other_masters: Evidence of another master, as text.
    """
    astray = [answer for answer in answers if is_astray(answer)]
    if not astray:
        return None
    first = astray[0]
    known = status_code(first.code)
    error = StateError(
        f"{described(first)}, out of OP",
        position=first.station.position,
        requested=int(AlState.OP),
        actual=(first.word or 0) & STATE_MASK,
        code=first.code,
        log=log,
        hint=_suspicion(first, other_masters) or known.cause or "see its manual",
    )
    for other in astray[1:]:
        error.add_note(f"also: {described(other)}")
    return error


def _suspicion(answer: Answer, other_masters: Sequence[str]) -> str:
    """Return the hint that another master is the cause.

    Empty if there is no evidence of another master and the device gives a reason.
    """
    if other_masters:
        return f"another EtherCAT master is live: {'; '.join(other_masters)}; end it"
    if answer.code or (answer.word or 0) & ERROR_FLAG:
        return ""
    return (
        "it gives no reason, so another program probably requested the state: check for a second "
        "master on this line or in another container. A device that was switched off and on also "
        "shows INIT"
    )


def address_error(silent: Sequence[Answer], al_status: int, log: Log | None) -> StateError:
    """Return the error for devices that lost their addresses while all frames return.

    Such a device was replaced, or was switched off for a short time.

    Args:
        silent: Answers of the devices that do not answer to their addresses.
        al_status: OR of the AL states of all devices.
        log: The last cycles.
    """
    first = silent[0]
    error = StateError(
        f"{first.station} does not answer to its address any more, and at least one device is not "
        f"in OP (OR of all AL status values: 0x{al_status:02X})",
        position=first.station.position,
        requested=int(AlState.OP),
        actual=int(AlState.INIT),
        code=0,
        log=log,
        hint="it was replaced, or switched off and on in a shorter time than lost_limit: check its "
        "supply; a new scan() and Loop start it again",
    )
    for other in silent[1:]:
        error.add_note(f"also: {other.station}")
    return error


class AxisTrouble(NamedTuple):
    """State and error code of one axis in trouble."""

    name: str
    state: AxisState | None
    code: int | str | None  # 0x603F, or diagnosis of SERCOS; None: it could not be read

    def __str__(self) -> str:
        state = self.state.name if self.state is not None else "no valid CiA 402 state"
        if self.code is None:
            return f"{self.name}: {state}, its error code cannot be read"
        if isinstance(self.code, str):
            return f"{self.name}: {state}, {self.code}"
        return f"{self.name}: {state}, error code 0x{self.code:04X} ({error_text(self.code)})"


def drive_error(axes: Sequence[AxisTrouble], what: str, log: Log | None) -> DriveError:
    """Return the error for axes in trouble.

    Args:
        axes: Names, states and error codes.
        what: Fact to report: "in fault", "cannot be enabled".
        log: The last cycles.
    """
    faulty = any(axis.state in IN_FAULT for axis in axes)
    hint = (
        "remove the cause, then open a new Loop: it resets the fault. To keep this loop open, use "
        "StopPolicy(raise_faults=False) and Drives.enable()"
        if faulty
        else "check the main supply, safe torque off and the enable input of the drive"
    )
    return DriveError(f"{what}: {'; '.join(map(str, axes))}", log=log, hint=hint)


def is_astray(answer: Answer) -> bool:
    """Return True if a device answers, and is out of OP or reports an error."""
    return answer.word is not None and answer.word & (STATE_MASK | ERROR_FLAG) != AlState.OP


def described(answer: Answer) -> str:
    """Return the device, its state and its reason as text."""
    assert answer.word is not None
    try:
        state = str(AlState(answer.word & STATE_MASK))
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
    """Return positions as text; "none" if there are none."""
    return ", ".join(map(str, positions)) or "none"

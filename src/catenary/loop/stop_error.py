"""Error for axes that the core stopped: reason, cycle and advice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from catenary.core import CYCLE_DRY, CYCLE_UNCOMMITTED
from catenary.errors import DriveError
from catenary.log import Log
from catenary.loop.watches.axis import StoppedAxis, mode_name
from catenary.plan.cycle import CyclePlan
from catenary.plan.stop_reason import StopReason
from catenary.wire.cia402 import Mode

ADVICE: dict[StopReason, str] = {
    StopReason.UNDERRUN: (
        "move slow work out of the loop body, keep more rows in the stream, "
        "or give StopPolicy(late_limit=...) a longer time [s]"
    ),
    StopReason.HANDOVER: (
        "start the next law or write torques in time, change to CSP before the law ends, "
        "or give StopPolicy(handover=...) a longer time [s]"
    ),
    StopReason.REFUSED: (
        "check for NaN or a jump in the targets: start at the commanded position and move in "
        "small steps; Drives(step_limit=...) allows larger ones"
    ),
    StopReason.POSITION_LIMIT: (
        "slow down before position_min and position_max; the drive's 0x607D may be tighter: "
        "print(loop.plan)"
    ),
    StopReason.NOT_FOLLOWING: (
        "check for an internal limit or a mode of the drive that ignores targets (statusword, "
        "bits 11 and 12)"
    ),
    StopReason.MODE_CHANGE: "check that the drive supports the mode (0x6502, its manual)",
    StopReason.COMMAND_TIMEOUT: (
        "update torques more often than that from a thread, use a law (loop.start), change to "
        "CSP, or give StopPolicy(command_timeout=...) a longer time [s]"
    ),
    StopReason.OPERATOR: "ask the operator; the axes wait for a new request",
    StopReason.NOT_ENABLED: "check main supply, safe torque off and enable input of the drive",
}
CONTINUE = (
    'StopPolicy(on_axis_stopped="event") keeps the loop running; '
    "Drives.enable() enables the axis again"
)


def stopped_error(stops: Sequence[StoppedAxis], cycle: CyclePlan, log: Log) -> DriveError:
    """Return the error for axes that were stopped without a request.

    Args:
        stops: Stops of axes, at least one.
        cycle: Plan of the cycle, for its times.
        log: The last cycles, oldest first.
    """
    alike: dict[str, list[str]] = {}
    for stop in stops:
        what = f"stopped in cycle {stop.cycle}: {stop.cause}{_details(stop, cycle, log)}"
        alike.setdefault(what, []).append(stop.name)
    report = "; ".join(
        f"{', '.join(names)} {'was' if len(names) == 1 else 'were'} {what}"
        for what, names in alike.items()
    )
    reasons = dict.fromkeys(stop.reason for stop in stops)
    advice = [ADVICE[reason] for reason in reasons if reason in ADVICE]
    return DriveError(report, log=log, hint="; ".join([*advice, CONTINUE]))


def _details(stop: StoppedAxis, cycle: CyclePlan, log: Log) -> str:
    """Return the exceeded time limit as text, with the late source of an underrun, or ""."""
    if stop.reason is StopReason.UNDERRUN:
        limit = _late_limit_ns(stop.mode, cycle) / 1e6
        return f" ({limit:g} ms in {mode_name(stop.mode)}), {_what_was_late(stop, log)}"
    if stop.reason is StopReason.HANDOVER:
        return f" ({cycle.handover_ns / 1e6:g} ms)"
    if stop.reason is StopReason.COMMAND_TIMEOUT:
        return f" ({cycle.command_timeout_torque_ns / 1e6:g} ms in CST)"
    return ""


def _late_limit_ns(mode: int, cycle: CyclePlan) -> int:
    if mode == Mode.CST:
        return cycle.late_limit_torque_ns
    if mode in (Mode.CSV, Mode.PV):
        return cycle.late_limit_velocity_ns
    return cycle.late_limit_position_ns


def _what_was_late(stop: StoppedAxis, log: Log) -> str:
    """Return the source of set-points that was late, and the number of cycles, as text."""
    before = log[log["number"] <= stop.cycle]
    if len(before) and before["flags"][-1] & CYCLE_DRY:
        return f"the stream was empty for {_trailing(before['flags'], CYCLE_DRY)} cycles"
    count = _trailing(before["flags"], CYCLE_UNCOMMITTED)
    return f"the program wrote no targets for {count} cycles" if count else "the program was late"


def _trailing(flags: npt.NDArray[np.uint32], bit: int) -> int:
    """Return the number of consecutive flags at the end that have the bit."""
    without = np.flatnonzero((flags & bit) == 0)
    return len(flags) - (int(without[-1]) + 1 if len(without) else 0)

"""Reasons for which the core stops an axis, with their text (docs/explanation/safety.md)."""

from __future__ import annotations

from enum import IntEnum


class StopReason(IntEnum):
    """Reason for which an axis was stopped. The core uses the same numbers."""

    NONE = 0
    UNDERRUN = 1
    HANDOVER = 2
    REFUSED = 3
    POSITION_LIMIT = 4
    NOT_FOLLOWING = 5
    MODE_CHANGE = 6
    NOT_ENABLED = 7
    DEVICE_LOST = 8
    LEFT_OPERATION = 9
    FAULT = 10
    STOP_REQUEST = 11
    COMMAND_TIMEOUT = 12
    OPERATOR = 13

    @property
    def text(self) -> str:
        """Description of the reason, to follow the name of an axis in a message."""
        return TEXTS[self]


TEXTS: dict[StopReason, str] = {
    StopReason.NONE: "not stopped",
    StopReason.UNDERRUN: "no fresh set-points within late_limit",
    StopReason.HANDOVER: "no torque set-points within `handover` after a law or stream ended",
    StopReason.REFUSED: "set-points refused (NaN, infinite or further than step_limit)",
    StopReason.POSITION_LIMIT: "moved away outside a position limit",
    StopReason.NOT_FOLLOWING: "the drive stopped following its targets (statusword bit 12)",
    StopReason.MODE_CHANGE: "the drive did not show the requested mode in 0x6061 in time",
    StopReason.NOT_ENABLED: "the request to enable was not fulfilled within 10 s",
    StopReason.DEVICE_LOST: "its device does not answer",
    StopReason.LEFT_OPERATION: "the drive left OPERATION_ENABLED by itself (STO, enable input)",
    StopReason.FAULT: "the drive is in fault",
    StopReason.STOP_REQUEST: "a stop was requested",
    StopReason.COMMAND_TIMEOUT: "the last loop.update() is older than command_timeout",
    StopReason.OPERATOR: "an operator requested a quick stop",
}

# Stops by the core itself: the iteration raises, unless on_axis_stopped is "event". Faults, lost
# devices and drives that left operation by themselves are handled separately.
UNASKED = frozenset(
    {
        StopReason.UNDERRUN,
        StopReason.HANDOVER,
        StopReason.REFUSED,
        StopReason.POSITION_LIMIT,
        StopReason.NOT_FOLLOWING,
        StopReason.MODE_CHANGE,
        StopReason.NOT_ENABLED,
        StopReason.COMMAND_TIMEOUT,
        StopReason.OPERATOR,
    }
)

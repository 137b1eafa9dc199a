"""Test traffic for cables, whose faults appear only while frames pass."""

from __future__ import annotations

from catenary.errors import NoDeviceError
from catenary.procedure.exchange import Procedure, Reply, Request, after
from catenary.procedure.station import Deadline
from catenary.wire.datagram import EcatCommand

PAUSE = 1e-3  # [s] between two frames
PATTERN = bytes(range(256)) * 5  # all byte values; nearly a full frame
LOST_IN_A_ROW_MAX = 50  # lost or damaged frames


def exercise(seconds: float) -> Procedure[tuple[int, int]]:
    """Send long frames, with pauses of one millisecond.

    Args:
        seconds: The duration [s].

    Returns:
        The number of sent frames, and the number of lost or damaged ones.

    Raises:
        NoDeviceError: `LOST_IN_A_ROW_MAX` frames in a row were lost or damaged.
    """
    deadline, sent, lost, lost_in_a_row = Deadline(seconds), 0, 0, 0
    while True:
        [reply] = yield [Request(EcatCommand.NOP, 0, PATTERN, False)]
        sent += 1
        lost_in_a_row = lost_in_a_row + 1 if _is_damaged(reply) else 0
        lost += bool(lost_in_a_row)
        if lost_in_a_row >= LOST_IN_A_ROW_MAX:
            raise NoDeviceError(
                f"the last {lost_in_a_row} of {sent} frames were lost or damaged",
                hint="check the cable to the first device, and the power of this device",
            )
        if deadline.passed(reply):
            return sent, lost
        yield after(PAUSE)


def _is_damaged(reply: Reply) -> bool:
    return reply.lost or reply.data != PATTERN

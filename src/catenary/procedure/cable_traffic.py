"""Test traffic: faults of a cable appear only while frames pass."""

from __future__ import annotations

from catenary.errors import NoDeviceError
from catenary.procedure.exchange import Procedure, Reply, Request, after
from catenary.procedure.station import Deadline
from catenary.wire.datagram import EcatCommand

PAUSE = 1e-3  # [s] between two frames
PATTERN = bytes(range(256)) * 5  # every byte value, nearly a full frame
IN_VAIN = 50  # lost frames in a row


def exercise(seconds: float) -> Procedure[tuple[int, int]]:
    """Send a long frame every millisecond for some time.

    Args:
        seconds: The duration.

    Returns:
        The number of sent frames, and of those that were lost or returned damaged.

    Raises:
        NoDeviceError: No frame comes back any more.
    """
    deadline, sent, lost, in_vain = Deadline(seconds), 0, 0, 0
    while True:
        [reply] = yield [Request(EcatCommand.NOP, 0, PATTERN, False)]
        sent += 1
        in_vain = in_vain + 1 if _spoilt(reply) else 0
        lost += bool(in_vain)
        if in_vain >= IN_VAIN:
            raise NoDeviceError(
                f"the last {in_vain} frames were lost or damaged, after {sent - in_vain} frames",
                hint="check the cable to the first device, and its power",
            )
        if deadline.passed(reply):
            return sent, lost
        yield after(PAUSE)


def _spoilt(reply: Reply) -> bool:
    return reply.lost or reply.data != PATTERN

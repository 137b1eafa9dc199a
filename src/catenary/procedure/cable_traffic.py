"""Traffic for its own sake: cables show their faults only to frames that pass."""

from __future__ import annotations

from catenary.errors import NoDeviceError
from catenary.procedure.exchange import Procedure, Reply, Request, after
from catenary.procedure.station import Deadline
from catenary.wire.datagram import EcatCommand

PAUSE = 1e-3  # [s] between two frames
PATTERN = bytes(range(256)) * 5  # every byte, and nearly a full frame
IN_VAIN = 50  # frames in a row that nobody gives back


def exercise(seconds: float) -> Procedure[tuple[int, int]]:
    """Sends a long frame every millisecond for some seconds; how many went out, and how many did
    not come back whole. NoDeviceError where the segment is gone."""
    deadline, sent, lost, in_vain = Deadline(seconds), 0, 0, 0
    while True:
        [reply] = yield [Request(EcatCommand.NOP, 0, PATTERN, False)]
        sent += 1
        in_vain = in_vain + 1 if _spoilt(reply) else 0
        lost += bool(in_vain)
        if in_vain >= IN_VAIN:
            raise NoDeviceError(
                f"no frame comes back any more, after {sent - in_vain} that did",
                hint="the cable to the first device, or its power",
            )
        if deadline.passed(reply):
            return sent, lost
        yield after(PAUSE)


def _spoilt(reply: Reply) -> bool:
    return reply.lost or reply.data != PATTERN

"""Detection of devices that answer but do not insert their process data, ETG.1000.4 §6.6.

Each device is checked with one logical read (LRD) of its inputs. Outputs are not checked, because
that would write them.
"""

from __future__ import annotations

from collections.abc import Mapping

from catenary.procedure.exchange import Procedure, Request
from catenary.wire.datagram import EcatCommand


def probe_inputs(areas: Mapping[int, tuple[int, int]]) -> Procedure[tuple[int, ...]]:
    """Return the positions of the devices that do not insert their inputs.

    A device whose frame is lost is not reported.

    Args:
        areas: Inputs of each device as (logical address, size [bytes]), by position.
    """
    if not areas:
        return ()
    replies = yield [
        Request(EcatCommand.LRD, start, bytes(length), True) for start, length in areas.values()
    ]
    return tuple(
        position
        for position, reply in zip(areas, replies, strict=True)
        if not reply.lost and reply.working_counter == 0
    )

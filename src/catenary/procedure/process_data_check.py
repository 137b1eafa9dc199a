"""Who does not put process data into the frame, though it answers to everything else: its inputs
alone, one logical read a device (LRD), ETG.1000.4 §6.6. Outputs are not asked for: that writes."""

from __future__ import annotations

from collections.abc import Mapping

from catenary.procedure.exchange import Procedure, Request
from catenary.wire.datagram import EcatCommand


def probe_inputs(areas: Mapping[int, tuple[int, int]]) -> Procedure[tuple[int, ...]]:
    """The positions of the devices whose inputs nobody gave. `areas`: by position, where their
    inputs lie: (logical address, bytes)."""
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

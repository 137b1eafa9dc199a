"""Error counters of all devices, read in shared frames: 20 bytes each, 46 devices per frame.

As in `survey`, a missing reply is not an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from catenary.procedure.exchange import Procedure, Request, read, write
from catenary.procedure.station import Station, answered
from catenary.wire.datagram import EcatCommand
from catenary.wire.error_counters import ErrorCounters, decode_error_counters
from catenary.wire.register import (
    ERROR_COUNTERS,
    FORWARDED_RX_ERROR_COUNTERS,
    LOST_LINK_COUNTERS,
    PDI_ERROR_COUNTER,
    PROCESSING_UNIT_ERROR_COUNTER,
    RX_ERROR_COUNTERS,
)

Totals: TypeAlias = tuple[ErrorCounters | None, ...]  # by position; None: no answer


def read_error_counters(stations: Sequence[Station]) -> Procedure[Totals]:
    """Read the counts of all devices; None for a device that did not answer.

    If all frames are lost, the result is None for every device.

    Raises:
        ResponseTimeout: Only some frames were lost. It is then unknown whether the devices in
            these frames answered.
    """
    if not stations:
        return ()
    replies = yield [
        read(EcatCommand.FPRD, station.address, ERROR_COUNTERS) for station in stations
    ]
    if all(reply.lost for reply in replies):
        return (None,) * len(stations)
    return tuple(
        None
        if reply.working_counter == 0 and not reply.lost
        else decode_error_counters(answered(reply, station, "error counters"))
        for station, reply in zip(stations, replies, strict=True)
    )


def counted_since(now: Totals, before: Totals) -> tuple[Totals, frozenset[int]]:
    """Return the counts between two readings, and the positions whose counters restarted.

    If a device did not answer the earlier reading, its later counts are returned unchanged.

    Args:
        now: The later reading.
        before: The earlier reading.
    """
    pairs = list(zip(now, before, strict=True))
    counted = tuple(new if new is None or old is None else new.since(old) for new, old in pairs)
    restarted = frozenset(
        position
        for position, (new, old) in enumerate(pairs)
        if new is not None and old is not None and new.restarted(old)
    )
    return counted, restarted


def clear_error_counters(stations: Sequence[Station]) -> Procedure[None]:
    """Clear all counters. A write of any value clears them (ESC data sheet II, §3.33 to §3.38)."""
    yield [request for station in stations for request in _clearing(station.address)]


def _clearing(address: int) -> list[Request]:
    return [
        write(EcatCommand.FPWR, address, RX_ERROR_COUNTERS, bytes(8)),
        write(EcatCommand.FPWR, address, FORWARDED_RX_ERROR_COUNTERS, bytes(4)),
        write(EcatCommand.FPWR, address, PROCESSING_UNIT_ERROR_COUNTER, 0),
        write(EcatCommand.FPWR, address, PDI_ERROR_COUNTER, 0),
        write(EcatCommand.FPWR, address, LOST_LINK_COUNTERS, bytes(4)),
    ]

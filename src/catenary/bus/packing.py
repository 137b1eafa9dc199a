"""Packing of procedures' requests into few frames, and unpacking of the replies.

Requests keep their order, so the requests of one procedure in a step are processed in that order.
All datagrams of a frame carry the index of the frame, 0x80 to 0xFF.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from catenary.procedure.exchange import Reply, Request
from catenary.wire import datagram as wire
from catenary.wire.datagram import OVERHEAD, Datagram, EcatCommand
from catenary.wire.frame import (
    ETHERNET_HEADER_SIZE,
    HEADER_SIZE,
    MAXIMUM_DATA,
    MAXIMUM_PAYLOAD,
    Frame,
    encode_frame,
)

INDEX_FIRST, INDEX_LAST = 0x80, 0xFF  # 0x00 to 0x7F belong to the cycle
_COUNTED_ADDRESS = frozenset(  # every device increments their ADP
    (
        EcatCommand.APRD,
        EcatCommand.APWR,
        EcatCommand.APRW,
        EcatCommand.ARMW,
        EcatCommand.BRD,
        EcatCommand.BWR,
        EcatCommand.BRW,
    )
)


@dataclass(frozen=True, slots=True)
class Parcel:
    """One frame with requests of procedures."""

    index: int
    frame: bytes
    requests: tuple[Request, ...]


def indices() -> Iterator[int]:
    """Yield the indices of procedures' frames endlessly."""
    while True:
        yield from range(INDEX_FIRST, INDEX_LAST + 1)


def batches(requests: Sequence[Request]) -> list[list[int]]:
    """Return the requests of each frame, as lists of ranks in order.

    Raises:
        ValueError: A request is too long for a frame.
    """
    found: list[list[int]] = []
    room = 0
    for rank, request in enumerate(requests):
        if len(request.data) > MAXIMUM_DATA:
            raise ValueError(
                f"datagram of {len(request.data)} bytes is too long: at most {MAXIMUM_DATA} bytes"
            )
        size = OVERHEAD + len(request.data)
        if size > room or request.alone:
            found.append([])
            room = MAXIMUM_PAYLOAD
        found[-1].append(rank)
        room = 0 if request.alone else room - size
    return found


def make_parcel(requests: Sequence[Request], index: int) -> Parcel:
    datagrams = [Datagram(r.command, r.address, r.data, index) for r in requests]
    return Parcel(index, encode_frame(datagrams), tuple(requests))


def expected_replies(parcel: Parcel, received: bytes, time_ns: int) -> list[Reply] | None:
    """Return the replies of a frame that differs from the sent one only where devices change it.

    This is the usual case for station addresses, and faster than `decode_frame` and `replies_of`.

    Args:
        parcel: Frame that was sent.
        received: Frame that was received.
        time_ns: Time of reception [ns].

    Returns:
        The replies; None if the frame must be decoded.
    """
    sent, place = parcel.frame, ETHERNET_HEADER_SIZE - 2  # the EtherType
    if len(received) < len(sent) or received[place:HEADER_SIZE] != sent[place:HEADER_SIZE]:
        return None
    replies: list[Reply] = []
    place = HEADER_SIZE
    for request in parcel.requests:
        start = place + wire.HEADER_SIZE
        end = start + len(request.data)
        if received[place : start - 2] != sent[place : start - 2]:  # all but the interrupt
            return None
        counter = received[end] | received[end + 1] << 8
        replies.append(Reply(received[start:end], counter, False, time_ns))
        place = end + wire.WORKING_COUNTER_SIZE
    return replies


def index_of(received: bytes) -> int:
    """Return the index of the first datagram; -1 if the frame is too short."""
    return received[HEADER_SIZE + 1] if len(received) > HEADER_SIZE + 1 else -1


def replies_of(parcel: Parcel, frame: Frame, time_ns: int) -> list[Reply] | None:
    """Return the replies of a frame; None if it is not the frame of this parcel.

    Args:
        parcel: Frame that was sent.
        frame: Frame that was received.
        time_ns: Time of reception [ns].
    """
    if len(frame.datagrams) != len(parcel.requests):
        return None
    for datagram, request in zip(frame.datagrams, parcel.requests, strict=True):
        if not _belongs(datagram, request, parcel.index):
            return None
    return [Reply(d.data, d.working_counter, False, time_ns) for d in frame.datagrams]


def _belongs(datagram: Datagram, request: Request, index: int) -> bool:
    if datagram.index != index or datagram.command != request.command:
        return False
    if len(datagram.data) != len(request.data):
        return False
    if datagram.command in _COUNTED_ADDRESS:
        return datagram.ado == request.address >> 16
    return datagram.address == request.address

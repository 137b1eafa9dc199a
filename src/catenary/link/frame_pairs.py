"""Pairs of sent and returned frames in a recording. The rules are in capture/direction.py."""

from __future__ import annotations

import os
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from catenary.capture.direction import LOST_NS, CapturedFrame, Shape, is_outbound, shape_of
from catenary.errors import DecodeError
from catenary.wire.capture import decode_capture
from catenary.wire.frame import decode_frame
from catenary.wire.pcapng import Packet


class Exchange(NamedTuple):
    """A sent frame and its answer."""

    sent: bytes
    answer: bytes
    latency_ns: int = 0


def read_exchanges(path: str | os.PathLike[str]) -> list[Exchange]:
    """Return the exchanges in a capture, pcapng or pcap, in the order of the answers.

    A truncated last packet is omitted.

    Raises:
        DecodeError: The file is not a pcapng or pcap capture.
        OSError: The file cannot be read.
    """
    return pair(decode_capture(Path(path).read_bytes()).packets)


def pair(packets: Iterable[Packet]) -> list[Exchange]:
    """Pair each answer with the oldest unanswered frame that has the same commands and indices.

    The lengths of the data must be equal as well. Frames without an answer within `LOST_NS` count
    as lost. Lost frames and frames of other protocols are omitted.
    """
    packets = list(packets)
    seen = list(_ethercat(packets))
    conclusive = _conclusive_sources(seen)
    waiting: dict[Shape, deque[CapturedFrame]] = defaultdict(deque)
    exchanges = []
    for each in seen:
        sent = waiting[shape_of(each.frame)]
        while sent and each.time_ns - sent[0].time_ns > LOST_NS:
            sent.popleft()
        oldest = sent[0] if sent else None
        if is_outbound(each, oldest, conclusive=each.frame.sender in conclusive):
            sent.append(each)
        elif oldest is not None:
            sent.popleft()
            question, answer = packets[oldest.number - 1].data, packets[each.number - 1].data
            exchanges.append(Exchange(question, answer, max(each.time_ns - oldest.time_ns, 0)))
    return exchanges


def _ethercat(packets: Iterable[Packet]) -> Iterator[CapturedFrame]:
    for number, packet in enumerate(packets, 1):
        try:
            frame = decode_frame(packet.data)
        except DecodeError:
            continue
        yield CapturedFrame(number, packet.time_ns, frame, len(packet.data), packet.direction)


def _conclusive_sources(seen: Iterable[CapturedFrame]) -> frozenset[bytes]:
    """Return the source addresses that occur with and without the bit that controllers set."""
    found: dict[bytes, set[bool]] = defaultdict(set)
    for each in seen:
        found[each.frame.sender].add(each.frame.has_passed_controller)
    return frozenset(source for source, bits in found.items() if len(bits) == 2)


def by_question(exchanges: Sequence[Exchange]) -> dict[bytes, list[Exchange]]:
    """Group exchanges by question, in order. Questions that differ only in indices are equal.

    Raises:
        DecodeError: A sent frame is not an EtherCAT frame.
    """
    found: dict[bytes, list[Exchange]] = defaultdict(list)
    for exchange in exchanges:
        found[question_of(exchange.sent)].append(exchange)
    return dict(found)


def question_of(sent: bytes) -> bytes:
    """Return the datagrams of a frame with all indices set to 0.

    Raises:
        DecodeError: The bytes are not an EtherCAT frame.
    """
    datagrams = decode_frame(sent).datagrams
    last = len(datagrams) - 1
    return b"".join(
        d.encode(more_follows=i < last)[:1] + b"\0" + d.encode(more_follows=i < last)[2:]
        for i, d in enumerate(datagrams)
    )

"""Pairs of sent and returned frames in a recording.

The first conclusive criterion determines whether a frame was sent or returned:

1. The file: pcapng can store the direction of a packet.
2. The source address: the first controller sets bit 1 of its first byte. This is inconclusive if
   all frames of an address have the bit, because the address of a virtual interface contains it
   (02:...). It is also inconclusive if none has the bit, because some simulators do not set it.
3. The content: a frame is sent with all working counters 0, and returns with larger ones. If no
   device answered, controllers have still incremented a position or broadcast address. A frame that
   returns unchanged returns at once, or with padding; a master repeats a frame only after some ms.
"""

from __future__ import annotations

import os
from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

from catenary.errors import DecodeError
from catenary.wire.capture import decode_capture
from catenary.wire.datagram import EcatCommand
from catenary.wire.frame import MINIMUM_SIZE, Frame, decode_frame
from catenary.wire.pcapng import Direction, Packet


class Exchange(NamedTuple):
    """A sent frame and its answer."""

    sent: bytes
    answer: bytes
    latency_ns: int = 0


Shape: TypeAlias = tuple[tuple[int, int, int], ...]

LOST_NS = 100_000_000  # later frames are not answers: masters wait 2 ms (SOEM) to 50 ms (ours)
AT_ONCE_NS = 1_000_000  # enough for a hundred devices; shorter than the repetition of any master

# Every controller increments the address of these commands (ETG.1000.4 §5.4.1.2)
_COUNTED_UP = frozenset(
    (
        *(EcatCommand.APRD, EcatCommand.APWR, EcatCommand.APRW, EcatCommand.ARMW),
        *(EcatCommand.BRD, EcatCommand.BWR, EcatCommand.BRW),
    )
)


class _Seen(NamedTuple):
    """A packet that is an EtherCAT frame."""

    packet: Packet
    frame: Frame


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
    seen = _ethercat(packets)
    conclusive = _conclusive_sources(seen)
    waiting: dict[Shape, deque[_Seen]] = defaultdict(deque)
    exchanges = []
    for each in seen:
        sent = waiting[shape_of(each.frame)]
        while sent and each.packet.time_ns - sent[0].packet.time_ns > LOST_NS:
            sent.popleft()
        if _is_outbound(each, sent, conclusive):
            sent.append(each)
        elif sent:
            question, answer = sent.popleft().packet, each.packet
            latency = max(answer.time_ns - question.time_ns, 0)
            exchanges.append(Exchange(question.data, answer.data, latency))
    return exchanges


def shape_of(frame: Frame) -> Shape:
    """Return command, index and data length of each datagram; an answer has the same."""
    return tuple((int(d.command), d.index, len(d.data)) for d in frame.datagrams)


def _ethercat(packets: Iterable[Packet]) -> list[_Seen]:
    found = []
    for packet in packets:
        try:
            found.append(_Seen(packet, decode_frame(packet.data)))
        except DecodeError:
            continue
    return found


def _conclusive_sources(seen: Iterable[_Seen]) -> frozenset[bytes]:
    """Return the source addresses that occur with and without the bit that controllers set."""
    found: dict[bytes, set[bool]] = defaultdict(set)
    for each in seen:
        found[each.frame.sender].add(each.frame.has_passed_controller)
    return frozenset(source for source, bits in found.items() if len(bits) == 2)


def _is_outbound(each: _Seen, waiting: Sequence[_Seen], conclusive: frozenset[bytes]) -> bool:
    if each.packet.direction is not Direction.UNKNOWN:
        return each.packet.direction is Direction.OUTBOUND
    if each.frame.sender in conclusive:
        return not each.frame.has_passed_controller
    if any(datagram.working_counter for datagram in each.frame.datagrams):
        return False
    return not (waiting and _came_back_uncounted(waiting[0], each))


def _came_back_uncounted(sent: _Seen, each: _Seen) -> bool:
    """Return True if no device answered, but controllers forwarded the frame."""
    pairs = list(zip(sent.frame.datagrams, each.frame.datagrams, strict=True))
    if any(a.data != b.data or a.ado != b.ado for a, b in pairs):
        return False
    if any(a.adp != b.adp for a, b in pairs):
        return all(a.adp == b.adp or a.command in _COUNTED_UP for a, b in pairs)
    padded = len(sent.packet.data) < MINIMUM_SIZE <= len(each.packet.data)
    return padded or each.packet.time_ns - sent.packet.time_ns <= AT_ONCE_NS


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

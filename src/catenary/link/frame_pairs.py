"""Pairs in a recording: a frame sent, and the frame as it came back.

The first of these that is conclusive shows whether a frame was sent or came back:

1. The file: pcapng can name the direction of a packet.
2. The source address: the first controller sets bit 1 of its first byte. It is inconclusive if
   all frames of an address have the bit, because the interface's own address has it (virtual
   interfaces, 02:...), or none has it, because a simulator does not set it.
3. The content: a frame is sent with all working counters 0 and comes back counted. Where no device
   counted it, controllers have still counted up a position or broadcast address. One that comes
   back as it was sent does so at once, or padded: a master repeats it after some ms only.
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
    sent: bytes
    answer: bytes
    latency_ns: int = 0


Shape: TypeAlias = tuple[tuple[int, int, int], ...]

LOST_NS = 100_000_000  # after which no answer comes: masters wait 2 ms (SOEM) to 50 ms (ours)
AT_ONCE_NS = (
    1_000_000  # in which no master repeats a frame, and a hundred devices have passed it on
)

# Every controller counts their address up by one (ETG.1000.4 §5.4.1.2)
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

    A truncated capture is read up to the cut. Raises DecodeError if it is not a capture.
    """
    return pair(decode_capture(Path(path).read_bytes()).packets)


def pair(packets: Iterable[Packet]) -> list[Exchange]:
    """Pairs each answer with the oldest unanswered frame of the same datagrams and indices that is
    not lost.

    Frames that are not EtherCAT's, and those never answered, are left out.
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
    """What an answer has in common with its question: addresses and data change on the way."""
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
    """True if no device answered, but controllers passed the frame on."""
    pairs = list(zip(sent.frame.datagrams, each.frame.datagrams, strict=True))
    if any(a.data != b.data or a.ado != b.ado for a, b in pairs):
        return False
    if any(a.adp != b.adp for a, b in pairs):
        return all(a.adp == b.adp or a.command in _COUNTED_UP for a, b in pairs)
    padded = len(sent.packet.data) < MINIMUM_SIZE <= len(each.packet.data)
    return padded or each.packet.time_ns - sent.packet.time_ns <= AT_ONCE_NS


def by_question(exchanges: Sequence[Exchange]) -> dict[bytes, list[Exchange]]:
    """The exchanges of each question, in order; questions are alike apart from their indices."""
    found: dict[bytes, list[Exchange]] = defaultdict(list)
    for exchange in exchanges:
        found[question_of(exchange.sent)].append(exchange)
    return dict(found)


def question_of(sent: bytes) -> bytes:
    """The datagrams of a frame with every index 0. DecodeError: no EtherCAT frame."""
    datagrams = decode_frame(sent).datagrams
    last = len(datagrams) - 1
    return b"".join(
        d.encode(more_follows=i < last)[:1] + b"\0" + d.encode(more_follows=i < last)[2:]
        for i, d in enumerate(datagrams)
    )

"""What a recording says a segment answered: pairs of a frame sent and the frame it came back as."""

from __future__ import annotations

import os
from collections import defaultdict, deque
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias

from catenary.errors import DecodeError
from catenary.wire.frame import Frame, decode_frame
from catenary.wire.pcapng import Direction, Packet, decode_capture


class Exchange(NamedTuple):
    sent: bytes
    answer: bytes
    latency_ns: int = 0


Shape: TypeAlias = tuple[tuple[int, int, int], ...]


def read_exchanges(path: str | os.PathLike[str]) -> list[Exchange]:
    """The exchanges in a pcapng file, in the order of the answers; DecodeError: no pcapng."""
    return pair(decode_capture(Path(path).read_bytes()).packets)


def pair(packets: Iterable[Packet]) -> list[Exchange]:
    """Pairs each answer with the oldest unanswered frame of the same datagrams and indices.

    Frames that are not EtherCAT's, and those never answered, are left out.
    """
    waiting: dict[Shape, deque[Packet]] = defaultdict(deque)
    exchanges = []
    for packet in packets:
        try:
            frame = decode_frame(packet.data)
        except DecodeError:
            continue
        sent = waiting[shape_of(frame)]
        if is_outbound(packet, frame):
            sent.append(packet)
        elif sent:
            question = sent.popleft()
            latency = max(packet.time_ns - question.time_ns, 0)
            exchanges.append(Exchange(question.data, packet.data, latency))
    return exchanges


def shape_of(frame: Frame) -> Shape:
    """What an answer has in common with its question: addresses and data change on the way."""
    return tuple((int(d.command), d.index, len(d.data)) for d in frame.datagrams)


def is_outbound(packet: Packet, frame: Frame) -> bool:
    """By the file's word, else by the bit of the source address that the first controller sets."""
    if packet.direction is not Direction.UNKNOWN:
        return packet.direction is Direction.OUTBOUND
    return not frame.has_passed_controller


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

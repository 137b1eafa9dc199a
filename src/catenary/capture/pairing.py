"""Pairs of sent and returned frames in a stream of frames, in constant memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from catenary.capture.direction import LOST_NS, CapturedFrame, is_outbound, shape_of

LOOK_AHEAD = 512  # frames that decide whether the source address shows the direction
MAXIMUM_WAITING = 256  # frames of one source on their way
MAXIMUM_SOURCES = 64


class FramePair(NamedTuple):
    """A sent frame and its answer. One of both may be missing."""

    source: bytes  # source address of the master, without the bit that controllers set
    sent: CapturedFrame | None
    answer: CapturedFrame | None
    under_way: bool = False  # the capture ends before the answer


class _Source:
    """Owner of the unanswered frames of one source address."""

    def __init__(self) -> None:
        self.bits: set[bool] = set()
        self.waiting: deque[CapturedFrame] = deque()

    def oldest_like(self, each: CapturedFrame) -> CapturedFrame | None:
        """Return the oldest waiting frame with the same commands, indices and lengths."""
        shape = shape_of(each.frame)
        return next((sent for sent in self.waiting if shape_of(sent.frame) == shape), None)

    def expired(self, now_ns: int) -> Iterator[CapturedFrame]:
        """Remove and yield the frames that are lost."""
        while self.waiting and (
            now_ns - self.waiting[0].time_ns > LOST_NS or len(self.waiting) > MAXIMUM_WAITING
        ):
            yield self.waiting.popleft()


def pair_frames(frames: Iterable[CapturedFrame]) -> Iterator[FramePair]:
    """Yield sent frames with their answers, in the order of the answers.

    Each answer is paired with the oldest unanswered frame of the same source that has the same
    commands, indices and data lengths. A frame without an answer within `LOST_NS` is yielded
    alone, and so is an answer to a frame that the capture does not contain. Frames of more than
    `MAXIMUM_SOURCES` source addresses are omitted.
    """
    sources: dict[bytes, _Source] = {}
    ahead: deque[CapturedFrame] = deque()
    for each in frames:
        if not _note(each, sources):
            continue
        ahead.append(each)
        if len(ahead) > LOOK_AHEAD:
            yield from _pair(ahead.popleft(), sources)
    last_ns = 0
    while ahead:
        last_ns = max(last_ns, ahead[0].time_ns)
        yield from _pair(ahead.popleft(), sources)
    for address, source in sources.items():
        for sent in source.waiting:
            yield FramePair(address, sent, None, under_way=last_ns - sent.time_ns <= LOST_NS)


def _note(each: CapturedFrame, sources: dict[bytes, _Source]) -> bool:
    """Note the source address of a frame. Return False if there are too many sources."""
    sender = each.frame.sender
    if sender not in sources and len(sources) >= MAXIMUM_SOURCES:
        return False
    sources.setdefault(sender, _Source()).bits.add(each.frame.has_passed_controller)
    return True


def _pair(each: CapturedFrame, sources: dict[bytes, _Source]) -> Iterator[FramePair]:
    address = each.frame.sender
    source = sources[address]
    for lost in source.expired(each.time_ns):
        yield FramePair(address, lost, None)
    waiting = source.oldest_like(each)
    if is_outbound(each, waiting, conclusive=len(source.bits) == 2):
        source.waiting.append(each)
        return
    if waiting is not None:
        source.waiting.remove(waiting)
    yield FramePair(address, waiting, each)

"""Pairs of sent and returned frames in a stream of frames, in constant memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from catenary.capture.direction import AT_ONCE_NS, LOST_NS, CapturedFrame, is_outbound, shape_of

LOOK_AHEAD = 512  # frames that decide whether the source address shows the direction
MAXIMUM_WAITING = 256  # frames of one source on their way
MAXIMUM_SOURCES = 64
MAXIMUM_COPIES = 4  # answered frames, and copies, that are kept for the next frames


class FramePair(NamedTuple):
    """A sent frame and its answer. One of both may be missing."""

    source: bytes  # source address of the master, without the bit that controllers set
    sent: CapturedFrame | None
    answer: CapturedFrame | None
    under_way: bool = False  # the capture ends before the answer
    collides: bool = False  # an equal frame of the same source was on its way: two programs?


class _Source:
    """Owner of the unanswered frames of one source address."""

    def __init__(self) -> None:
        self.bits: set[bool] = set()
        self.waiting: deque[CapturedFrame] = deque()
        self.colliding: set[int] = set()  # numbers of waiting frames
        self.answered: deque[CapturedFrame] = deque(maxlen=MAXIMUM_COPIES)  # sent frames
        self.copies: deque[CapturedFrame] = deque(maxlen=MAXIMUM_COPIES)

    def oldest_like(self, each: CapturedFrame) -> CapturedFrame | None:
        """Return the oldest waiting frame with the same commands, indices and lengths."""
        shape = shape_of(each.frame)
        return next((sent for sent in self.waiting if shape_of(sent.frame) == shape), None)

    def has_copy(self, each: CapturedFrame) -> bool:
        """Return True if the same frame was sent just before, on the other interface of a ring.

        The second copy of a frame also returns without having passed a controller.
        """
        return any(
            each.time_ns - sent.time_ns < AT_ONCE_NS
            and sent.frame.datagrams == each.frame.datagrams
            for sent in (*self.waiting, *self.answered)
        )

    def take_copy(self, answer: CapturedFrame) -> CapturedFrame | None:
        """Remove and return the copy to which a second answer belongs: that of another program."""
        shape = shape_of(answer.frame)
        for copy in self.copies:
            if answer.time_ns - copy.time_ns < AT_ONCE_NS and shape_of(copy.frame) == shape:
                self.copies.remove(copy)
                return copy
        return None

    def expired(self, now_ns: int) -> Iterator[CapturedFrame]:
        """Remove and yield the frames that are lost."""
        while self.waiting and (
            now_ns - self.waiting[0].time_ns > LOST_NS or len(self.waiting) > MAXIMUM_WAITING
        ):
            lost = self.waiting.popleft()
            self.colliding.discard(lost.number)
            yield lost


def pair_frames(frames: Iterable[CapturedFrame]) -> Iterator[FramePair]:
    """Yield sent frames with their answers, in the order of the answers.

    Each answer is paired with the oldest unanswered frame of the same source that has the same
    commands, indices and data lengths. A frame without an answer within `LOST_NS` is yielded
    alone, and so is an answer to a frame that the capture does not contain. Copies of a sent frame
    in a ring are omitted, and so are frames of more than `MAXIMUM_SOURCES` source addresses.
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
    conclusive = len(source.bits) == 2
    if is_outbound(each, waiting, conclusive=conclusive):
        if conclusive and source.has_copy(each):
            source.copies.append(each)
            return
        if conclusive and waiting and each.time_ns - waiting.time_ns < AT_ONCE_NS:
            source.colliding.add(each.number)
        source.waiting.append(each)
        return
    collides = False
    if waiting is None:
        waiting = source.take_copy(each)
        collides = waiting is not None
    else:
        source.waiting.remove(waiting)
        source.answered.append(waiting)
        collides = waiting.number in source.colliding
        source.colliding.discard(waiting.number)
    yield FramePair(address, waiting, each, collides=collides)

"""Direction of a captured frame: sent by the master, or returned by the segment.

The first conclusive criterion decides:

1. The file: pcapng can store the direction of a packet.
2. The source address: the first controller sets bit 1 of its first byte. This is inconclusive if
   all frames of an address have the bit, because the address of a virtual interface contains it
   (02:...). It is also inconclusive if none has the bit, because some simulators do not set it.
3. The content: a frame is sent with all working counters 0, and returns with larger ones. If no
   device answered, controllers have still incremented a position or broadcast address. A frame that
   returns unchanged returns at once, or with padding; a master repeats a frame only after some ms.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from catenary.wire.datagram import EcatCommand
from catenary.wire.frame import MINIMUM_SIZE, Frame
from catenary.wire.pcapng import Direction

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


class CapturedFrame(NamedTuple):
    """An EtherCAT frame with its place in the file."""

    number: int  # of the packet in the file, from 1, as in Wireshark
    time_ns: int
    frame: Frame
    size: int  # bytes captured
    direction: Direction = Direction.UNKNOWN


def shape_of(frame: Frame) -> Shape:
    """Return command, index and data length of each datagram; an answer has the same."""
    return tuple((int(d.command), d.index, len(d.data)) for d in frame.datagrams)


def is_outbound(each: CapturedFrame, waiting: CapturedFrame | None, *, conclusive: bool) -> bool:
    """Return True if the master sent the frame, False if the frame returned.

    Args:
        each: The frame.
        waiting: The oldest unanswered frame with the same shape and source; None if none waits.
        conclusive: True if frames of this source occur with and without the controllers' bit.
    """
    if each.direction is not Direction.UNKNOWN:
        return each.direction is Direction.OUTBOUND
    if conclusive:
        return not each.frame.has_passed_controller
    if any(datagram.working_counter for datagram in each.frame.datagrams):
        return False
    return waiting is None or not _came_back_uncounted(waiting, each)


def _came_back_uncounted(sent: CapturedFrame, each: CapturedFrame) -> bool:
    """Return True if no device answered, but controllers forwarded the frame."""
    pairs = list(zip(sent.frame.datagrams, each.frame.datagrams, strict=True))
    if any(a.data != b.data or a.ado != b.ado for a, b in pairs):
        return False
    if any(a.adp != b.adp for a, b in pairs):
        return all(a.adp == b.adp or a.command in _COUNTED_UP for a, b in pairs)
    padded = sent.size < MINIMUM_SIZE <= each.size
    return padded or each.time_ns - sent.time_ns <= AT_ONCE_NS

"""Ethernet frames in fragments of EoE, ETG.1000.6 §5.7.2: division and reassembly."""

from __future__ import annotations

from collections import Counter
from enum import Enum

from catenary.wire.eoe import BLOCK, HEADER_SIZE, Fragment

MIN_FRAME, MAX_FRAME = 14, 1522  # [bytes] without checksum: header only; with two VLAN tags
FRAGMENT_TIMEOUT_NS = 1_000_000_000  # between two fragments of one frame
_BLOCKS_MAX = 63  # of the field


class Drop(Enum):
    """Reason for which a frame, or a fragment of it, was dropped."""

    DUPLICATE = "duplicate fragment"  # the frame is kept
    ORDER = "fragment out of order"
    INCOMPLETE = "last fragment missing"
    TOO_LONG = "more data than announced, or than an Ethernet frame can have"
    TOO_SHORT = "shorter than the header of an Ethernet frame"
    TIMEOUT = "next fragment too late"


def fragment_room(data_room: int) -> int:
    """Return the data of a full fragment [bytes]: whole blocks.

    Args:
        data_room: Data of a mailbox message [bytes].
    """
    return (data_room - HEADER_SIZE) // BLOCK * BLOCK


def fragments_of(frame: bytes, number: int, data_room: int) -> list[Fragment]:
    """Divide an Ethernet frame.

    Args:
        frame: The frame, without its checksum.
        number: Number of the frame, 0 to 15.
        data_room: Data of a mailbox message [bytes].

    Raises:
        ValueError: The frame is too long, or not even one block fits into a message.
    """
    room = fragment_room(data_room)
    if room < BLOCK:
        raise ValueError(
            f"EoE needs mailbox messages of at least {HEADER_SIZE + BLOCK} bytes, not {data_room}"
        )
    if len(frame) > MAX_FRAME:
        raise ValueError(f"an Ethernet frame has at most {MAX_FRAME} bytes, not {len(frame)}")
    found: list[Fragment] = []
    start = 0
    while True:
        last = len(frame) - start <= data_room - HEADER_SIZE
        part = frame[start:] if last else frame[start : start + room]
        blocks = -(-len(frame) // BLOCK) if start == 0 else start // BLOCK
        found.append(Fragment(len(found), blocks, number, part, last))
        if last:
            return found
        start += room


class FrameAssembler:
    """Owner of one incomplete frame of a device. It never has more than `MAX_FRAME` bytes.

    Fragments of one frame arrive in order. As in SOEM (ec_eoe.c) and IgH (ethernet.c), a frame may
    be shorter than announced in fragment 0, but not longer.
    """

    def __init__(self) -> None:
        self.drops: Counter[Drop] = Counter()
        self._last: Fragment | None = None  # last fragment of the incomplete frame
        self._data = bytearray()
        self._limit = 0
        self._time_ns = 0

    def add(self, fragment: Fragment, time_ns: int) -> bytes | None:
        """Add a fragment. Return the frame if it is complete, without its time stamp.

        Args:
            fragment: The fragment.
            time_ns: Time of its arrival [ns].
        """
        self.expire(time_ns)
        last = self._last
        if last is not None and fragment == last:
            self.drops[Drop.DUPLICATE] += 1
            return None
        if fragment.number == 0:
            if last is not None:
                self._drop(Drop.INCOMPLETE)
            self._data = bytearray()
            self._limit = min(fragment.blocks * BLOCK, MAX_FRAME)
        elif last is None or not self._continues(last, fragment):
            self._drop(Drop.ORDER)
            return None
        if len(self._data) + len(fragment.data) > self._limit:
            self._drop(Drop.TOO_LONG)
            return None
        self._data += fragment.data
        self._last, self._time_ns = fragment, time_ns
        return self._complete() if fragment.last else None

    def expire(self, time_ns: int) -> None:
        """Drop an incomplete frame if its next fragment is late.

        Args:
            time_ns: Present time [ns].
        """
        if self._last is not None and time_ns - self._time_ns > FRAGMENT_TIMEOUT_NS:
            self._drop(Drop.TIMEOUT)

    def reset(self) -> None:
        """Forget an incomplete frame, because the mailbox was restarted."""
        self._last = None
        self._data = bytearray()

    def _continues(self, last: Fragment, fragment: Fragment) -> bool:
        return (
            fragment.number == last.number + 1
            and fragment.frame == last.frame
            and fragment.blocks * BLOCK == len(self._data)
        )

    def _complete(self) -> bytes | None:
        frame = bytes(self._data)
        self.reset()
        if len(frame) < MIN_FRAME:
            self.drops[Drop.TOO_SHORT] += 1
            return None
        return frame

    def _drop(self, reason: Drop) -> None:
        """Count a drop, and forget the incomplete frame."""
        self.drops[reason] += 1
        self.reset()

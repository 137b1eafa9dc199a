"""Fragments of a device's Ethernet frames, ETG.1000.6 §5.7.2, and their faults.

The code is independent of the codec `catenary.wire.eoe_frames`, so that each tests the other.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

HEADER = struct.Struct("<HH")
LAST, TIME_APPENDED = 0x100, 0x200
FRAME_MAX = 1522
ENDLESS = 80  # fragments of an endless frame


class Part(NamedTuple):
    """One fragment of a frame to send."""

    number: int
    blocks: int
    last: bool
    data: bytes


def divided(frame: bytes, room: int) -> list[Part]:
    """Return the fragments of a frame.

    Args:
        frame: The frame, with its time stamp, if any.
        room: Data of a mailbox message [bytes].
    """
    full = (room - HEADER.size) // 32 * 32
    starts = [0]
    while len(frame) - starts[-1] > room - HEADER.size:
        starts.append(starts[-1] + full)
    ends = [*starts[1:], len(frame)]
    return [
        Part(
            number,
            start // 32 if number else (len(frame) + 31) // 32,
            end == len(frame),
            frame[start:end],
        )
        for number, (start, end) in enumerate(zip(starts, ends, strict=True))
    ]


def spoiled(parts: list[Part], fault: str) -> list[Part]:
    """Return the fragments with a fault of `Ethernet.fragments`."""
    if fault == "duplicate":
        return [each for each in parts for _ in range(2)]
    if fault == "reordered":
        return parts[::-1]
    if fault == "lost":
        return parts[:1] + parts[2:] if len(parts) > 1 else []
    if fault == "longer":
        return [parts[0]._replace(blocks=1), *parts[1:]]
    if fault == "endless":
        data = parts[0].data[: len(parts[0].data) // 32 * 32]
        offsets = [k * len(data) // 32 & 63 for k in range(ENDLESS)]
        return [Part(k & 63, offset or 63, False, data) for k, offset in enumerate(offsets)]
    return parts


def encoded(part: Part, frame_number: int, *, time_stamp: bool) -> bytes:
    """Return the data of a mailbox message.

    Args:
        part: The fragment.
        frame_number: Number of the frame, 0 to 15.
        time_stamp: True if the frame ends with a time stamp.
    """
    flags = (LAST | (TIME_APPENDED if time_stamp else 0)) if part.last else 0
    return HEADER.pack(flags, part.number | part.blocks << 6 | frame_number << 12) + part.data


class Collector:
    """Owner of the frame that the MainDevice is sending."""

    def __init__(self) -> None:
        self.reset()
        self.refused = 0  # fragments that did not fit

    def reset(self) -> None:
        """Forget an incomplete frame."""
        self._expected, self._number, self._size = 0, 0, 0
        self._data = bytearray()

    def add(self, payload: bytes) -> bytes | None:
        """Add a message. Return the frame if it is complete."""
        flags, word = HEADER.unpack_from(payload)
        number, blocks, frame = word & 0x3F, word >> 6 & 0x3F, word >> 12
        data = payload[HEADER.size :]
        if number == 0:
            self.reset()
            self._number, self._size = frame, min(32 * blocks, FRAME_MAX)
        fits = len(self._data) + len(data) <= self._size
        follows = number == 0 or (frame == self._number and 32 * blocks == len(self._data))
        if number != self._expected or not fits or not follows:
            self.refused += 1
            self.reset()
            return None
        self._data += data
        self._expected += 1
        if not flags & LAST:
            return None
        found = bytes(self._data[:-4] if flags & TIME_APPENDED else self._data)
        self.reset()
        return found

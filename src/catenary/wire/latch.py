"""Latch unit of distributed clocks, registers 0x09A8 to 0x09CF.

Source: Beckhoff, ESC data sheet, section II, 0x09A8 to 0x09C8. The unit stores the system time of
an edge. In continuous mode, each edge replaces the last time. In single-event mode, the unit keeps
the first edge until its time is read.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntFlag

from catenary.errors import DecodeError

BLOCK = 0x09AE  # status of both inputs, followed by their times
BLOCK_SIZE = 0x09D0 - BLOCK
INPUTS = 2
EDGES = ("rising", "falling")
_STATUS_SIZE = 2
_BLOCK = struct.Struct("<2B4Q")


class LatchControl(IntFlag):
    """Bits of 0x09A8 and 0x09A9. If the bit of an edge is 0, its mode is continuous."""

    SINGLE_RISING = 0x01
    SINGLE_FALLING = 0x02


class LatchStatus(IntFlag):
    """Bits of 0x09AE and 0x09AF. The event bits are used only in single-event mode."""

    RISING = 0x01
    FALLING = 0x02
    PIN = 0x04


@dataclass(frozen=True, slots=True)
class Latched:
    """Status and times of one latch input."""

    status: LatchStatus
    rising_ns: int
    falling_ns: int


def decode_latched(data: bytes, number: int, clock_bits: int) -> Latched:
    """Return the status and times of a latch input.

    Args:
        data: Registers 0x09AE to 0x09CF.
        number: Number of the input, 0 or 1.
        clock_bits: Width of the clock, 32 or 64. The upper half of a time is unused with 32 bits.

    Raises:
        DecodeError: The data has the wrong length.
        ValueError: The input does not exist.
    """
    if not 0 <= number < INPUTS:
        raise ValueError(f"latch input {number}: must be 0 or 1")
    if len(data) != BLOCK_SIZE:
        raise DecodeError(f"latch unit: needs {BLOCK_SIZE} bytes, received {len(data)}")
    values = _BLOCK.unpack(data)
    mask = (1 << clock_bits) - 1
    rising, falling = values[_STATUS_SIZE + 2 * number :][:2]
    return Latched(LatchStatus(values[number] & 0x07), rising & mask, falling & mask)

"""Latch unit of distributed clocks, registers 0x09A8 to 0x09CF.

Source: Beckhoff, ESC data sheet, section II, 0x09A8 to 0x09C8. The unit stores the system time of
an edge. In continuous mode, each edge replaces the last time. In single-event mode, the unit keeps
the first edge until its time is read.
"""

from __future__ import annotations

import struct
from enum import IntFlag

from catenary.errors import DecodeError

TIMES_SIZE = 16  # of one input: rising edge, then falling edge
INPUTS = 2
EDGES = ("rising", "falling")
_TIMES = struct.Struct("<2Q")


class LatchControl(IntFlag):
    """Bits of 0x09A8 and 0x09A9. If the bit of an edge is 0, its mode is continuous."""

    SINGLE_RISING = 0x01
    SINGLE_FALLING = 0x02


class LatchStatus(IntFlag):
    """Bits of 0x09AE and 0x09AF. The event bits are used only in single-event mode."""

    RISING = 0x01
    FALLING = 0x02
    PIN = 0x04


def decode_times(data: bytes, clock_bits: int) -> tuple[int, int]:
    """Return the times of the last rising and the last falling edge [ns].

    Args:
        data: Registers of the times of one input.
        clock_bits: Width of the clock, 32 or 64. The upper half of a time is unused with 32 bits.

    Raises:
        DecodeError: The data has the wrong length.
    """
    if len(data) != TIMES_SIZE:
        raise DecodeError(f"latch times: need {TIMES_SIZE} bytes, received {len(data)}")
    mask = (1 << clock_bits) - 1
    rising, falling = _TIMES.unpack(data)
    return rising & mask, falling & mask

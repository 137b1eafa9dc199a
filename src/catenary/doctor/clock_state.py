"""Adjustment of the kernel's clock: adjtimex(2), read-only."""

from __future__ import annotations

import ctypes
import time
from dataclasses import dataclass

NOMINAL_TICK_US = 10_000  # USER_HZ is 100 on the supported architectures
FREQUENCY_UNIT = 65_536.0  # ppm in 16.16 bits
STA_NANO = 0x2000  # linux/timex.h: offset in ns


@dataclass(frozen=True, slots=True)
class ClockState:
    """Adjustment of the clock.

    slew_ppm: current rate deviation of CLOCK_MONOTONIC from the crystal; positive if fast.
    offset: remaining time to slew [s]. resolution: resolution of timers [s]. tai_offset: CLOCK_TAI
    minus UTC [s]; 0 if no program has set it.
    """

    slew_ppm: float
    offset: float
    resolution: float
    tai_offset: int = 0


class Timex(ctypes.Structure):
    """`struct timex` of linux/timex.h; `rest` covers the unused fields."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("constant", ctypes.c_long),
        ("precision", ctypes.c_long),
        ("tolerance", ctypes.c_long),
        ("time", ctypes.c_long * 2),
        ("tick", ctypes.c_long),
        ("rest", ctypes.c_byte * 128),
    )


def read_clock_state() -> ClockState | None:
    """Return the state of the clock; None if the kernel refuses the call."""
    timex = Timex(modes=0)
    if ctypes.CDLL(None).adjtimex(ctypes.byref(timex)) < 0:
        return None
    unit = 1e-9 if timex.status & STA_NANO else 1e-6
    return ClockState(
        slew_ppm=(timex.tick - NOMINAL_TICK_US) * 100.0 + timex.freq / FREQUENCY_UNIT,
        offset=timex.offset * unit,
        resolution=time.clock_getres(time.CLOCK_MONOTONIC),
        tai_offset=round(time.clock_gettime(time.CLOCK_TAI) - time.time()),
    )

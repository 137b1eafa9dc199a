"""Distributed clocks, registers 0x0900 to 0x09FF, ETG.1000.4 §6.8.

The module covers receive times, the time loop, and the activation of the SYNC unit.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntFlag

from catenary.errors import DecodeError

SIZE = 56  # 0x0900 to 0x0937
_BLOCK = struct.Struct("<4IQQQIIHhBBBx")
_RECEIVE_TIMES = struct.Struct("<4I")
_SIGN = 1 << 31


class CyclicUnit(IntFlag):
    """Bits of the cyclic unit control register (0x0980).

    The PDI controls a unit if its bit is set; otherwise EtherCAT controls it.
    """

    SYNC_BY_PDI = 0x01
    LATCH0_BY_PDI = 0x10
    LATCH1_BY_PDI = 0x20


class Activation(IntFlag):
    """Bits of the SYNC activation register (0x0981)."""

    CYCLIC_OPERATION = 0x01
    SYNC0 = 0x02
    SYNC1 = 0x04
    AUTO_ACTIVATION = 0x08
    EXTEND_START_TIME = 0x10
    CHECK_START_TIME = 0x20
    NEAR_FUTURE_ONE_SECOND = 0x40
    DEBUG_PULSE = 0x80


@dataclass(frozen=True, slots=True)
class Clock:
    """State of the time loop of one device. All times are in ns."""

    receive_times_ns: tuple[int, int, int, int]  # by port, in local time
    system_time_ns: int
    receive_time_processing_unit_ns: int
    offset_ns: int  # modulo 2**64
    delay_ns: int
    difference_ns: int  # local copy of the system time minus the received system time
    speed_counter_start: int
    speed_counter_difference: int
    difference_filter: int
    speed_counter_filter: int
    latch_mode: int = 0

    def encode(self) -> bytes:
        """Return the encoded block. Raises ValueError if a field does not fit."""
        try:
            return _BLOCK.pack(
                *self.receive_times_ns,
                *(self.system_time_ns, self.receive_time_processing_unit_ns, self.offset_ns),
                *(self.delay_ns, encode_difference(self.difference_ns)),
                *(self.speed_counter_start, self.speed_counter_difference),
                *(self.difference_filter, self.speed_counter_filter, self.latch_mode),
            )
        except struct.error as error:
            raise ValueError(f"distributed clock: {error}") from None


def decode_clock(data: bytes) -> Clock:
    """Decode the 56 bytes of the time loop, from 0x0900 on."""
    if len(data) != SIZE:
        raise DecodeError(f"distributed clock: needs {SIZE} bytes, received {len(data)}")
    time_0, time_1, time_2, time_3, *rest = _BLOCK.unpack(data)
    system_time, processing_unit, offset, delay, difference, *filters = rest
    return Clock(
        (time_0, time_1, time_2, time_3),
        *(system_time, processing_unit, offset, delay, decode_difference(difference)),
        *filters,
    )


def decode_receive_times(data: bytes) -> tuple[int, int, int, int]:
    """Return the local times [ns] at which the latching write arrived at the four ports."""
    if len(data) != _RECEIVE_TIMES.size:
        raise DecodeError(f"receive times: needs {_RECEIVE_TIMES.size} bytes, received {len(data)}")
    port_0, port_1, port_2, port_3 = _RECEIVE_TIMES.unpack(data)
    return port_0, port_1, port_2, port_3


def encode_receive_times(times: tuple[int, int, int, int]) -> bytes:
    """Encode four receive times [ns] in 16 bytes. Raises ValueError if one does not fit."""
    try:
        return _RECEIVE_TIMES.pack(*times)
    except struct.error as error:
        raise ValueError(f"receive times: {error}") from None


def decode_difference(raw: int) -> int:
    """Return the system time difference [ns] for a raw value of register 0x092C.

    The register is sign-magnitude. If bit 31 is set, the local copy of the system time lags behind.
    Negative zero is decoded as 0.
    """
    if not 0 <= raw <= 0xFFFF_FFFF:
        raise DecodeError(f"system time difference: {raw} does not fit into 32 bits")
    magnitude = raw & ~_SIGN
    return -magnitude if raw & _SIGN else magnitude


def encode_difference(difference_ns: int) -> int:
    """Return the raw value of register 0x092C. Raises ValueError if it does not fit."""
    if abs(difference_ns) >= _SIGN:
        raise ValueError(f"system time difference: {difference_ns} ns is beyond ±{_SIGN - 1} ns")
    return -difference_ns | _SIGN if difference_ns < 0 else difference_ns

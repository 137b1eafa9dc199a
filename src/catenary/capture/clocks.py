"""Distributed clocks in a capture: differences of devices, drift of the reference clock."""

from __future__ import annotations

from dataclasses import dataclass

from catenary.capture.contents import ClockDifference
from catenary.capture.spread import Slope
from catenary.capture.transaction import Transaction
from catenary.wire.clock import decode_difference
from catenary.wire.datagram import EcatCommand
from catenary.wire.register import SYSTEM_TIME, SYSTEM_TIME_DIFFERENCE, SYSTEM_TIME_LOW

_FIRST_LEVEL_NS = 1000  # smaller differences have one level
_DISTRIBUTING = (EcatCommand.FRMW, EcatCommand.ARMW)


@dataclass(frozen=True, slots=True)
class ClockStatistics:
    """System time differences of a device, read from register 0x092C."""

    reads: int
    first_ns: int
    last_ns: int
    largest_ns: int  # by magnitude


class ClockLevel:
    """Owner of the system time differences of one device."""

    def __init__(self) -> None:
        self._levels: tuple[int, int] | None = None  # lowest and highest
        self._first = self._last = self._largest = 0
        self._reads = 0

    def follow(self, each: Transaction) -> ClockDifference | None:
        """Follow a datagram. Return an event if the difference has a new order of magnitude."""
        data = each.was_read(SYSTEM_TIME_DIFFERENCE)
        if data is None:
            return None
        difference = decode_difference(int.from_bytes(data, "little"))
        self._first = difference if self._reads == 0 else self._first
        self._last = difference
        self._largest = max(self._largest, difference, key=abs)
        self._reads += 1
        level = len(str(abs(difference) // _FIRST_LEVEL_NS)) if abs(difference) > 999 else 0
        lowest, highest = self._levels or (level, level)
        is_new = self._levels is None or level < lowest or level > highest
        self._levels = min(lowest, level), max(highest, level)
        return ClockDifference(difference) if is_new else None

    @property
    def statistics(self) -> ClockStatistics | None:
        """The differences; None if none was read."""
        if not self._reads:
            return None
        return ClockStatistics(self._reads, self._first, self._last, self._largest)


@dataclass(frozen=True, slots=True)
class ReferenceStatistics:
    """Distribution of the system time by FRMW or ARMW.

    `drift_ppm` is the rate of the reference clock relative to the clock of the capture: the slope
    of a least-squares line. It is None if the capture is shorter than 1 s.
    """

    address: int  # station address or position of the reference clock
    by_position: bool
    datagrams: int
    span_ns: int
    drift_ppm: float | None


class ReferenceClock:
    """Owner of the times that the reference clock has distributed."""

    def __init__(self) -> None:
        self._address: tuple[int, bool] | None = None
        self._count = 0
        self._first_ns = self._last_ns = 0
        self._last_system = self._elapsed_system = 0
        self._drift = Slope()

    def follow(self, each: Transaction) -> None:
        """Follow a datagram of any device."""
        if each.command not in _DISTRIBUTING or each.ado != SYSTEM_TIME.address:
            return
        data = each.was_read(SYSTEM_TIME_LOW)
        if data is None:
            return
        system = int.from_bytes(data, "little")
        address = (each.address & 0xFFFF, each.by_position)
        if address != self._address:
            self._address, self._count = address, 0
        self._count += 1
        step = _step(system - self._last_system, each.time_ns - self._last_ns)
        if self._count == 1 or step is None:  # the master has written the clock
            self._first_ns, self._elapsed_system = each.time_ns, 0
            self._drift = Slope()
        else:
            self._elapsed_system += step
        elapsed = each.time_ns - self._first_ns
        self._drift.add(elapsed, self._elapsed_system - elapsed)
        self._last_ns, self._last_system = each.time_ns, system

    @property
    def statistics(self) -> ReferenceStatistics | None:
        """The distribution; None if the capture contains none."""
        if self._address is None:
            return None
        span = self._last_ns - self._first_ns
        drift = self._drift.slope * 1e6 if span >= _SHORTEST_SPAN_NS else None
        return ReferenceStatistics(*self._address, self._count, span, drift)


_SHORTEST_SPAN_NS = 1_000_000_000  # jitter of the time stamps would dominate shorter ones
_LARGEST_ERROR_NS = 10_000_000
_WRAP = 1 << 32


def _step(difference: int, elapsed_ns: int) -> int | None:
    """Return the time [ns] between two readings of 32 bits; None if the clock was set.

    Args:
        difference: Difference of the readings.
        elapsed_ns: Time between them on the clock of the capture.
    """
    error = (difference - elapsed_ns + _WRAP // 2) % _WRAP - _WRAP // 2
    return elapsed_ns + error if abs(error) <= _LARGEST_ERROR_NS else None

"""Check of the sequence numbers of a device: lost and reordered samples, restarts."""

from __future__ import annotations

from catenary.sensors.sensor import Counters

REORDER_MAX = 64  # a number that is lower by more belongs to a new sequence
LOST_MAX = 100_000  # a number that is higher by more belongs to a new sequence


class SequenceCheck:
    """Owner of the last sequence number of a device.

    Args:
        counters: counts `lost`, `reordered` and `restarts`.
        modulus: number after which the sequence wraps to 0.
        first: first number after a restart of the device.
    """

    def __init__(self, counters: Counters, modulus: int, first: int = 0) -> None:
        self._counters, self._modulus, self._first = counters, modulus, first
        self._last: int | None = None

    def accept(self, number: int) -> bool:
        """Check the next number. Return False for a sample that is older than the last one.

        Samples of a new sequence are accepted, and count as a restart.
        """
        if self._last is None:
            self._last = number
            return True
        step = (number - self._last) % self._modulus
        step = step if step <= self._modulus // 2 else step - self._modulus
        is_late = -REORDER_MAX <= step <= 0
        if is_late and (number != self._first or step == 0):
            self._counters.reordered += 1
            return False
        self._last = number
        if is_late or step < 0 or step > LOST_MAX:
            self._counters.restarts += 1
        else:
            self._counters.lost += step - 1
        return True

    def restart(self) -> None:
        """Accept any next number without a count."""
        self._last = None

"""KernelClock: clock figures of a kernel master, in the form of `core.Clock`."""

from __future__ import annotations

from catenary.igh._ecrt import Exchange
from catenary.plan.cycle import ClockPlan
from catenary.wire.clock import decode_difference


class KernelClock:
    """Clock differences of the devices on a kernel master. Implements `bus.CycleClock`.

    The phase and the largest difference of all devices are measured in every cycle; `locked` is
    computed from them. Differences of single devices are read by requests, one device after the
    other, a few per second. libethercat has no cyclic call for them.
    """

    def __init__(self, exchange: Exchange, plan: ClockPlan) -> None:
        self.plan = plan
        self._exchange = exchange
        self._differences = {position: (0.0, 0, 0, 0) for position in plan.followers}
        self._turn = 0

    def figures(self) -> dict[str, float]:
        return self._exchange.clock_figures()

    def differences(self) -> list[tuple[float, int, int, int]]:
        return list(self._differences.values())

    def keep_within(self, bound_ns: int) -> None:
        self._exchange.keep_within(bound_ns)

    def reset_figures(self) -> None:
        self._exchange.reset_clock_figures()
        for position, (mean, last, _, reads) in self._differences.items():
            self._differences[position] = (mean, last, 0, reads)

    @property
    def changes(self) -> int:
        return self._exchange.clock_changes

    def next_device(self) -> int | None:
        """Return the position of the device to read next; None if there are no followers."""
        if not self._differences:
            return None
        self._turn = (self._turn + 1) % len(self._differences)
        return list(self._differences)[self._turn]

    def note(self, position: int, register: bytes) -> None:
        """Record the system time difference of a device.

        Args:
            position: The position of the device.
            register: Its register 0x092C, 4 bytes: difference from the last reference time.
        """
        found = decode_difference(int.from_bytes(register, "little"))
        mean, _, worst, reads = self._differences[position]
        mean = mean + (found - mean) / 4 if reads else float(found)
        self._differences[position] = (mean, found, max(worst, abs(found)), reads + 1)

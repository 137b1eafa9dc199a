"""KernelClock: what a kernel master knows of its clocks, as a loop asks its own engine."""

from __future__ import annotations

from catenary.igh._ecrt import Exchange
from catenary.plan.cycle import ClockPlan
from catenary.wire.clock import decode_difference


class KernelClock:
    """Owns the differences that were read. Fulfils `bus.CycleClock`.

    The phase comes from every cycle, and so does the largest difference of all devices, which is
    what `locked` goes by. What single devices differ is read one after the other by requests, some
    a second: libethercat has no cyclic way.
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
        """The position whose difference is read next; None: there are no followers."""
        if not self._differences:
            return None
        self._turn = (self._turn + 1) % len(self._differences)
        return list(self._differences)[self._turn]

    def note(self, position: int, register: bytes) -> None:
        """A device's 0x092C: its difference to what it last heard of the reference."""
        found = decode_difference(int.from_bytes(register, "little"))
        mean, _, worst, reads = self._differences[position]
        mean = mean + (found - mean) / 4 if reads else float(found)
        self._differences[position] = (mean, found, max(worst, abs(found)), reads + 1)

"""The distributed clocks of a loop: how far apart they are, and whether within the bound."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from catenary.bus import CycleClock, MainDevice, SubDevice
from catenary.bus.event_types import ClockLocked, ClockUnlocked
from catenary.core import Engine
from catenary.errors import ClockError
from catenary.link import ring_of
from catenary.plan.cycle import ClockPlan
from catenary.plan.start_up import DevicePlan
from catenary.procedure.exchange import Procedure
from catenary.procedure.sync import rejoin

NS = 1e-9
SETTLE_TIMEOUT = 2.0  # [s] before OP is asked for: drives check their synchronisation on the way
SILENT = 16  # cycles in a row without the reference: not a lost frame


class Clocks:
    """Owns the view of an open loop's distributed clocks; figures are of the last cycle.

    Print it for a table. All times in seconds.
    """

    def __init__(
        self,
        main: MainDevice,
        engine: Engine,
        clock: CycleClock,
        plan: ClockPlan,
        cycle: Callable[[], int],
    ) -> None:
        self._main = main
        self._engine = engine
        self._clock = clock
        self._plan = plan
        self._cycle = cycle  # one without an application, of all who share the time
        self._ring = ring_of(main.link)
        self._announced = False
        self._announcing = threading.Lock()  # who iterates, and who looks at a ring's cables

    @property
    def reference(self) -> SubDevice:
        """The device whose clock all others follow."""
        return self._main.subs[self._plan.reference]

    @property
    def locked(self) -> bool:
        """True if all differences and the phase of the cycle starts are within the bound. Never
        while devices are cut off from the reference clock by a ring that is open."""
        return bool(self._clock.figures()["locked"]) and self._cut is None

    @property
    def bound(self) -> float:
        """Of differences and phase [s]."""
        return self._clock.figures()["bound"] * NS

    @property
    def time(self) -> float:
        """What the reference clock said last [s]: on a NIC since 2000-01-01, in virtual time since
        the segment's start."""
        return self._clock.figures()["time"] * NS

    @property
    def differences(self) -> Mapping[int, float]:
        """By position, what each clock is ahead of the reference (0x092C) [s]: a mean over the last
        readings, one device's a cycle. NaN before the first."""
        return {
            position: mean * NS if reads else float("nan")
            for position, (mean, _, _, reads) in self._readings()
        }

    @property
    def largest_differences(self) -> Mapping[int, float]:
        """By position, the largest single reading since the loop was entered or `reset` [s]."""
        return {position: worst * NS for position, (_, _, worst, _) in self._readings()}

    @property
    def phase_error(self) -> float:
        """Lateness of the cycle starts in the reference's time [s]; if the reference follows the
        MainDevice, how far it is ahead. A mean over some 16 cycles."""
        return self._clock.figures()["mean_error"] * NS

    @property
    def largest_phase_error(self) -> float:
        """The largest of a single cycle since the loop was entered or `reset` [s]."""
        return self._clock.figures()["worst_error"] * NS

    @property
    def rate(self) -> float:
        """By which share the reference clock runs faster than the machine's, as the phase
        controller found it; 0 where the reference follows."""
        return self._clock.figures()["rate"]

    @property
    def missed(self) -> int:
        """Cycles without an answer of the reference clock."""
        return int(self._clock.figures()["missed"])

    @property
    def jumps(self) -> int:
        """How often the reference clock has jumped by more than an eighth of a period."""
        return int(self._clock.figures()["jumps"])

    def reset(self) -> None:
        """Forgets the largest figures so far."""
        self._clock.reset_figures()

    def wait(self, within: float, timeout: float, check: Callable[[int], None]) -> None:
        """See `Loop.wait_locked`; `check` raises for cycles in trouble."""
        if not within > 0:
            raise ValueError(f"within={within} s: a bound is positive")
        self._clock.keep_within(max(1, round(within * 1e9)))
        self._run_until_locked(timeout, check)
        if not self.locked:
            raise ClockError(
                f"clocks not within {within * 1e6:g} us after {timeout:g} s: {self._trouble()}",
                hint="a longer timeout, or a wider bound: print(loop.clocks) shows all of them",
            )

    def settle(self, check: Callable[[int], None]) -> None:
        """Before OP: in phase, if that can be had soon."""
        self._run_until_locked(SETTLE_TIMEOUT, check)

    def rejoin(self, position: int, plan: DevicePlan) -> Procedure[None]:
        """Sets the clock of a device that was switched off, and starts its SYNC signals, on its way
        from PRE-OP to SAFE-OP. Nothing for one without a clock."""
        devices = [sub.description for sub in self._main.subs]
        delay, nearest = (self._main.clock_delays_ns[p] for p in (position, self._plan.reference))
        if not devices[position].clock_bits or delay is None or nearest is None:
            return
        figures = self._clock.figures()
        epoch_ns = int(figures["time"] - figures["time_sent"])
        peers = (self._plan.reference, *self._plan.followers)
        behind = max(0, delay - nearest)
        yield from rejoin(devices, position, plan.sync, peers, behind, epoch_ns)

    def announce(self) -> None:
        """Puts an event where the clocks have come together or apart since the last one."""
        with self._announcing:
            _ = self._clock.changes  # what follows tells of all of them
            locked = self.locked
            if locked is self._announced:
                return
            self._announced = locked
            self._main.events.put(self._event(locked))

    def __str__(self) -> str:
        state = "locked" if self.locked else "not locked"
        lines = [
            f"clocks {state} within {self.bound * 1e6:g} us; reference: {self.reference.station}",
            f"phase of the cycle starts {self.phase_error * 1e6:+.3f} us, at most "
            f"{self.largest_phase_error * 1e6:.3f} us; rate {self.rate * 1e6:+.2f} ppm",
        ]
        largest = self.largest_differences
        lines += [
            f"{self._main.subs[position].station}: {difference * 1e6:+.3f} us, "
            f"at most {largest[position] * 1e6:.3f} us"
            for position, difference in self.differences.items()
        ]
        return "\n".join(lines)

    def _readings(self) -> list[tuple[int, tuple[float, int, int, int]]]:
        return list(zip(self._plan.followers, self._clock.differences(), strict=True))

    def _run_until_locked(self, timeout: float, check: Callable[[int], None]) -> None:
        deadline = self._engine.now() + round(timeout * 1e9)
        check(self._cycle())  # takes a new bound over
        while not self.locked and self._engine.now() < deadline:
            check(self._cycle())

    def _worst(self) -> tuple[SubDevice, float]:
        """Who is furthest off, and by how much [s]; the reference stands for the phase."""
        found = {self._plan.reference: self.phase_error, **self.differences}
        off = {p: float("inf") if d != d else d for p, d in found.items()}  # NaN: never read
        position = max(off, key=lambda p: abs(off[p]))
        return self._main.subs[position], off[position]

    @property
    def _cut(self) -> int | None:
        """The position in front of a ring's cut that parts the clocks; -1: the first cable. Behind
        it they are led by the time that is expected of the reference: nobody compares the two."""
        if self._ring is None:
            return None
        cut, clocks = self._ring.state.cut_behind, (self._plan.reference, *self._plan.followers)
        return cut if cut is not None and any(position > cut for position in clocks) else None

    def _trouble(self) -> str:
        cut = self._cut
        if cut is not None:
            return f"the ring is cut: from device {cut + 1} on none hears the reference clock"
        if self._silent:
            return f"{self.reference.station}, the reference clock, does not answer"
        sub, difference = self._worst()
        if sub is self.reference:
            return (
                f"the cycle starts are {difference * 1e6:+.3f} us off the reference clock's phase"
            )
        if difference == float("inf"):
            return f"{sub.station} has not told its difference"
        return f"{sub.station} is {difference * 1e6:+.3f} us off {self.reference.station}"

    @property
    def _silent(self) -> bool:
        return self._clock.figures()["silent"] >= SILENT

    def _event(self, locked: bool) -> ClockLocked | ClockUnlocked:
        now = self._engine.now() * NS
        sub, difference = self._worst()
        within = f"{self.bound * 1e6:g} us"
        if locked:
            return ClockLocked(now, None, f"all clocks are within {within}", difference, self.bound)
        who = self.reference if self._silent else sub
        message = f"clocks left the bound of {within}: {self._trouble()}"
        return ClockUnlocked(now, who, message, difference, self.bound)

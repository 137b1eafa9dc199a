"""Distributed clocks of a loop: their differences, phase error and synchronisation."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping

from catenary.bus import CycleClock, MainDevice, SubDevice
from catenary.bus.event_types import ClockLocked, ClockUnlocked
from catenary.core import Cycle, Engine
from catenary.errors import ClockError
from catenary.link import ring_of
from catenary.plan.cycle import ClockPlan
from catenary.plan.start_up import DevicePlan
from catenary.procedure.exchange import Procedure
from catenary.procedure.sync import rejoin

NS = 1e-9
SETTLE_TIMEOUT = 2.0  # [s] longest wait for locked clocks; drives check them on the way to OP
SILENT = 16  # consecutive cycles without the reference clock: too many for lost frames


class Clocks:
    """View of an open loop's distributed clocks, as of the last cycle.

    Print it for a table. All times are in seconds.
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
        self._cycle = cycle  # runs one cycle of all networks, without the application
        self._ring = ring_of(main.link)
        self._announced = False
        self._announcing = threading.Lock()  # for the iterating thread and the ring watch

    @property
    def reference(self) -> SubDevice:
        """Device with the reference clock, which all other clocks follow."""
        return self._main.subs[self._plan.reference]

    @property
    def locked(self) -> bool:
        """True if all differences and the phase of the cycle starts are within the bound.

        False while an open ring separates devices from the reference clock.
        """
        return bool(self._clock.figures()["locked"]) and self._cut is None

    @property
    def bound(self) -> float:
        """Bound of the differences and of the phase error [s]."""
        return self._clock.figures()["bound"] * NS

    @property
    def time(self) -> float:
        """Last time that was read from the reference clock [s].

        It counts from 2000-01-01 on a NIC, and from the start of the segment in virtual time.
        """
        return self._clock.figures()["time"] * NS

    @property
    def cycle_start_ns(self) -> int:
        """System time of the distributed clocks at the start of the present cycle [ns]."""
        figures = self._clock.figures()
        started = self._engine.origin + self._engine.time_ns
        return int(figures["time"]) - int(figures["time_sent"]) + started

    def loop_time(self, system_time_ns: int, cycle: Cycle, *, bits: int = 64) -> float:
        """Return a system time of the distributed clocks on the clock of the loop, as `cycle.time`.

        Args:
            system_time_ns: System time, such as `LatchEvent.time_ns` [ns].
            cycle: Present cycle.
            bits: Width of the time, 32 or 64. With 32 bits, it must be within 2.1 s of the cycle.

        Returns:
            The time [s].
        """
        half = 1 << bits - 1
        age = (self.cycle_start_ns - system_time_ns + half) % (2 * half) - half
        return cycle.time - age * NS

    @property
    def differences(self) -> Mapping[int, float]:
        """Offset of each clock from the reference (0x092C) [s], by position; positive: ahead.

        Each value is a mean over the last readings. Each cycle reads one device. NaN before the
        first reading.
        """
        return {
            position: mean * NS if reads else float("nan")
            for position, (mean, _, _, reads) in self._readings()
        }

    @property
    def largest_differences(self) -> Mapping[int, float]:
        """Largest magnitude of a single reading, by position [s].

        This is the largest since the loop was entered or since `reset`.
        """
        return {position: worst * NS for position, (_, _, worst, _) in self._readings()}

    @property
    def phase_error(self) -> float:
        """Lateness of the cycle starts in the reference's time [s], a mean over about 16 cycles.

        If the reference follows the MainDevice, it is the offset by which the reference is ahead.
        """
        return self._clock.figures()["mean_error"] * NS

    @property
    def largest_phase_error(self) -> float:
        """Largest magnitude of the phase error in a cycle, since the entry or `reset` [s]."""
        return self._clock.figures()["worst_error"] * NS

    @property
    def rate(self) -> float:
        """Relative rate of the reference clock against the machine's clock; positive: faster.

        The phase controller estimates it. It is 0 if the reference follows the MainDevice.
        """
        return self._clock.figures()["rate"]

    @property
    def missed(self) -> int:
        """Number of cycles without an answer from the reference clock."""
        return int(self._clock.figures()["missed"])

    @property
    def jumps(self) -> int:
        """Number of jumps of the reference clock by more than an eighth of a period."""
        return int(self._clock.figures()["jumps"])

    def reset(self) -> None:
        """Reset the largest values."""
        self._clock.reset_figures()

    def wait(self, within: float, timeout: float, check: Callable[[int], None]) -> None:
        """Run cycles until the clocks are locked: see `Loop.wait_locked`.

        Args:
            within: Bound [s].
            timeout: Longest wait [s].
            check: Function that gets the flags of each cycle. It raises the error of a bad cycle.

        Raises:
            ValueError: `within` is not positive.
            ClockError: The clocks are not locked after `timeout`.
            CatenaryError: The error that `check` raised.
        """
        if not within > 0:
            raise ValueError(f"within={within} s: must be positive")
        self._clock.keep_within(max(1, round(within * 1e9)))
        self._run_until_locked(timeout, check)
        if not self.locked:
            raise ClockError(
                f"clocks not within {within * 1e6:g} us after {timeout:g} s: {self._trouble()}",
                hint="use a longer timeout or a larger bound; print(loop.clocks) shows all clocks",
            )

    def settle(self, check: Callable[[int], None]) -> None:
        """Run cycles until the clocks are locked, at most for SETTLE_TIMEOUT.

        A timeout is not an error.

        Args:
            check: Function that gets the flags of each cycle. It raises the error of a bad cycle.
        """
        self._run_until_locked(SETTLE_TIMEOUT, check)

    def rejoin(self, position: int, plan: DevicePlan) -> Procedure[None]:
        """Set the clock and start the SYNC signals of a device that was switched off.

        The procedure runs between PRE-OP and SAFE-OP. It is a no-op if the device has no clock, or
        if the delay of the device or of the reference is unknown.

        Args:
            position: Position of the device.
            plan: Plan of the device.
        """
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
        """Put an event if `locked` has changed since the last event; acknowledge all changes."""
        with self._announcing:
            _ = self._clock.changes  # acknowledged here: the event below covers all changes
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
        check(self._cycle())  # applies a new bound
        while not self.locked and self._engine.now() < deadline:
            check(self._cycle())

    def _worst(self) -> tuple[SubDevice, float]:
        """Return the clock with the largest offset, and the offset [s].

        The reference clock has the phase error as its offset.
        """
        found = {self._plan.reference: self.phase_error, **self.differences}
        off = {p: float("inf") if d != d else d for p, d in found.items()}  # NaN: not read yet
        position = max(off, key=lambda p: abs(off[p]))
        return self._main.subs[position], off[position]

    @property
    def _cut(self) -> int | None:
        """Position of the last device before the cut of a ring; -1 if the first cable is cut.

        None if no cut separates clocks from the reference. Clocks after the cut follow the
        extrapolated time of the reference, and their differences are not measured.
        """
        if self._ring is None:
            return None
        cut, clocks = self._ring.state.cut_behind, (self._plan.reference, *self._plan.followers)
        return cut if cut is not None and any(position > cut for position in clocks) else None

    def _trouble(self) -> str:
        cut = self._cut
        if cut is not None:
            return f"the ring is cut: devices from {cut + 1} on do not receive the reference clock"
        if self._silent:
            return f"{self.reference.station}, the reference clock, does not answer"
        sub, difference = self._worst()
        if sub is self.reference:
            return (
                f"the cycle starts are {difference * 1e6:+.3f} us off the reference clock's phase"
            )
        if difference == float("inf"):
            return f"the difference of {sub.station} has not been read yet"
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
        message = f"clocks exceeded the bound of {within}: {self._trouble()}"
        return ClockUnlocked(now, who, message, difference, self.bound)

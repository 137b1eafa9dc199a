"""Discipline of the cycle starts to an external clock: offsets in, rate of the periods out.

A PI controller keeps the phase of the cycle starts in the time of an external clock, as phc2sys(8)
keeps a system clock: https://manpages.ubuntu.com/manpages/noble/man8/phc2sys.8.html. In contrast to
phc2sys, it never steps. A step of the cycle starts would appear as a jump of the set-points.
Every error is corrected by longer or shorter periods, within a limit of the rate.

The gains are those of a critically damped loop, as in `plan.clocks`. The integral part is the rate
of the external clock. While the clock is lost, the periods keep this rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

RATE_LIMIT = 300e-6  # two crystals of 100 ppm each, and a reserve to correct the phase
BOUND = 10e-6  # [s]
TIME_CONSTANT = 1.0  # [s]
INTERVAL = 0.1  # [s] between two samples
LOST_AFTER = 1.0  # [s] without an accepted sample
DRIFT_MAX = 1e-3  # largest plausible rate between two clocks; more is a jump
NOISE_NS = 5_000  # error of a sample, in addition to the rate
JUMP_SAMPLES = 3  # consecutive samples that agree with each other mean a jump
SETTLE_SAMPLES = 5  # consecutive samples within the bound until the state is "locked"

ExternalState = Literal["seeking", "locked", "lost"]


class ClockSample(NamedTuple):
    """Reading of both clocks, and the newest cycle start."""

    local_ns: int  # link's clock
    offset_ns: int  # external clock minus link's clock
    cycle_start_ns: int  # on the link's clock


@dataclass(frozen=True, slots=True, kw_only=True)
class DisciplineOptions:
    """Settings of a `Discipline`.

    Args:
        period_ns: Period of the cycle [ns].
        phase_ns: Phase of the cycle starts in the period of the external clock [ns].
        rate_limit: Largest relative change of a period.
        bound_ns: Phase error that counts as locked [ns].
    """

    period_ns: int
    phase_ns: int = 0
    rate_limit: float = RATE_LIMIT
    bound_ns: int = round(BOUND * 1e9)

    @property
    def interval(self) -> float:
        """Time between two samples [s]; at least two periods."""
        return max(INTERVAL, 2e-9 * self.period_ns)

    @property
    def time_constant(self) -> float:
        """Time constant of the controller [s]; at least ten samples."""
        return max(TIME_CONSTANT, 10 * self.interval)


class Discipline:
    """Controller of the cycle starts. It owns the estimated rate and the state of the clock.

    Args:
        options: Settings.
        now_ns: Time on the link's clock [ns].
    """

    def __init__(self, options: DisciplineOptions, now_ns: int) -> None:
        self.state: ExternalState = "seeking"
        self.error_ns = 0  # last phase error; positive: the cycle start was late
        self.drift = 0.0  # lasting relative change of the periods
        self.jumps = 0  # number of jumps of the external clock
        self.ignored = 0  # number of samples that did not fit the previous ones
        self._options = options
        self._last: ClockSample | None = None
        self._candidate: ClockSample | None = None
        self._agreeing = 0  # samples in a row that agree with the candidate
        self._accepted_ns = now_ns  # local time of the last accepted sample
        self._good = 0

    def step(self, now_ns: int, sample: ClockSample | None) -> float:
        """Advance the controller by one sample.

        Args:
            now_ns: Time on the link's clock [ns].
            sample: Readings; None if the external clock did not answer.

        Returns:
            Relative change of the period until the next sample; positive: longer.
        """
        if sample is None or not self._accept(sample):
            if now_ns - self._accepted_ns > max(LOST_AFTER, 3 * self._options.interval) * 1e9:
                self.state, self._good = "lost", 0
            return self.drift
        self.error_ns = self._phase_error(sample)
        elapsed = min((now_ns - self._accepted_ns) * 1e-9, 2 * self._options.interval)
        self._accepted_ns = now_ns
        self._judge()
        return self._correct(self.error_ns * 1e-9, elapsed)

    def _accept(self, sample: ClockSample) -> bool:
        """Return True for a sample that continues the previous ones, or that confirms a jump."""
        repeats = self._candidate is not None and _agree(self._candidate, sample)
        if not repeats and (self._last is None or _agree(self._last, sample)):
            self._candidate = None
        elif not self._confirms_jump(sample, repeats):
            self.ignored += 1
            return False
        self._last = sample
        return True

    def _confirms_jump(self, sample: ClockSample, repeats: bool) -> bool:
        self._agreeing = self._agreeing + 1 if repeats else 1
        self._candidate = sample
        if self._agreeing < JUMP_SAMPLES:
            return False
        self.jumps += 1
        self._candidate = None
        return True

    def _phase_error(self, sample: ClockSample) -> int:
        """Return the lateness of the cycle start, within half a period [ns]."""
        period = self._options.period_ns
        late = sample.cycle_start_ns + sample.offset_ns - self._options.phase_ns
        return (late + period // 2) % period - period // 2

    def _judge(self) -> None:
        bound = self._options.bound_ns
        self._good = self._good + 1 if abs(self.error_ns) <= bound else 0
        if self.state == "locked" and abs(self.error_ns) <= 2 * bound:
            return  # hysteresis
        self.state = "locked" if self._good >= SETTLE_SAMPLES else "seeking"

    def _correct(self, error: float, elapsed: float) -> float:
        """Return the rate for an error [s]; integrate it over the elapsed time [s]."""
        limit, bandwidth = self._options.rate_limit, 1 / self._options.time_constant
        wanted = self.drift - 2 * bandwidth * error
        rate = max(-limit, min(limit, wanted))
        if rate == wanted or (wanted > 0) == (error > 0):  # anti-windup: integrate only inwards
            drift = self.drift - bandwidth**2 * error * elapsed
            self.drift = max(-limit, min(limit, drift))
        return rate


def _agree(one: ClockSample, other: ClockSample) -> bool:
    """Return True if the offsets differ by no more than clocks can drift apart."""
    elapsed = abs(other.local_ns - one.local_ns)
    return abs(other.offset_ns - one.offset_ns) <= DRIFT_MAX * elapsed + NOISE_NS

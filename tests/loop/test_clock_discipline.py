"""Discipline of the cycle starts: a clock that drifts, jumps, stops, vanishes and returns."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from catenary.loop.clock_discipline import (
    LOST_AFTER,
    ClockSample,
    Discipline,
    DisciplineOptions,
)

PERIOD_NS = 1_000_000
OPTIONS = DisciplineOptions(period_ns=PERIOD_NS, phase_ns=250_000)


@dataclass
class Bench:
    """Cycle starts with an adjustable rate, and an external clock as a function of local time."""

    external: Callable[[float], float | None]  # local time [s] → external time [s]; None: no answer
    options: DisciplineOptions = OPTIONS
    local_ns: float = 0.0
    cycle_start_ns: float = 0.0
    rate: float = 0.0
    rates: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.discipline = Discipline(self.options, 0)

    def run(self, seconds: float) -> None:
        """Advance the local time and the cycle starts from sample to sample."""
        interval_ns = self.options.interval * 1e9
        for _ in range(round(seconds * 1e9 / interval_ns)):
            self.local_ns += interval_ns
            self.cycle_start_ns += interval_ns * (1 + self.rate)
            time = self.external(self.local_ns * 1e-9)
            sample = None
            if time is not None:
                offset_ns = round(time * 1e9 - self.local_ns)
                sample = ClockSample(round(self.local_ns), offset_ns, round(self.cycle_start_ns))
            self.rate = self.discipline.step(round(self.local_ns), sample)
            self.rates.append(self.rate)

    @property
    def lateness_ns(self) -> float:
        """Phase of the cycle starts after the multiples of the external period, without wrapping.

        Computed from the state of the bench, and not by the controller.
        """
        time = self.external(self.local_ns * 1e-9)
        assert time is not None
        starts = self.cycle_start_ns + time * 1e9 - self.local_ns - self.options.phase_ns
        return math.remainder(starts, PERIOD_NS)


@pytest.mark.parametrize("ppm", [-200, -20, 0, 200])
@pytest.mark.parametrize("offset", [0.0, 0.123_456_7, -3.000_499])
def test_it_follows_a_clock_with_another_rate(ppm: float, offset: float) -> None:
    bench = Bench(lambda t: offset + t * (1 + ppm * 1e-6))
    bench.run(20)
    assert bench.discipline.state == "locked"
    assert abs(bench.lateness_ns) < 100
    assert bench.discipline.drift == pytest.approx(-ppm * 1e-6, abs=1e-7)
    assert max(map(abs, bench.rates)) <= OPTIONS.rate_limit


def test_it_follows_a_crystal_that_warms_up() -> None:
    bench = Bench(lambda t: t + 20e-6 * t * t / 120)  # 20 ppm per minute
    bench.run(60)
    assert bench.discipline.state == "locked"
    assert abs(bench.lateness_ns) < OPTIONS.bound_ns
    assert bench.discipline.jumps == 0


def test_one_wrong_reading_has_no_effect() -> None:
    bench = Bench(lambda t: t + (0.000_4 if 19.95 < t < 20.05 else 0.0))
    bench.run(19.9)
    before = bench.rate
    bench.run(0.3)
    assert bench.discipline.ignored == 1
    assert abs(bench.rate - before) < 1e-6
    assert (bench.discipline.state, bench.discipline.jumps) == ("locked", 0)


def test_a_jump_is_corrected_slowly() -> None:
    bench = Bench(lambda t: t + (0.000_4 if t > 20 else 0.0))
    bench.run(20)
    bench.rates.clear()
    bench.run(0.5)
    assert (bench.discipline.state, bench.discipline.jumps) == ("seeking", 1)
    bench.run(20)
    assert bench.discipline.state == "locked"
    assert abs(bench.lateness_ns) < 100
    assert max(map(abs, bench.rates)) <= OPTIONS.rate_limit


def test_a_jump_by_whole_periods_changes_nothing() -> None:
    bench = Bench(lambda t: t + (37.0 if t > 20 else 0.0))  # such as UTC instead of TAI
    bench.run(21)
    assert (bench.discipline.state, bench.discipline.jumps) == ("locked", 1)


@pytest.mark.parametrize("fault", ["vanishes", "stops"])
def test_the_rate_stays_while_the_clock_is_lost(fault: str) -> None:
    def external(t: float) -> float | None:
        if 20 < t <= 50:
            return None if fault == "vanishes" else 20.0
        return t * (1 + 50e-6)

    bench = Bench(external)
    bench.run(20)
    bench.rates.clear()
    bench.run(LOST_AFTER)
    assert bench.discipline.state == "locked"  # a short gap is not a loss
    bench.run(29)
    assert bench.discipline.state == "lost"
    assert bench.rates[5:] == pytest.approx([-50e-6] * len(bench.rates[5:]), abs=1e-6)
    bench.run(20)
    assert bench.discipline.state == "locked"
    assert abs(bench.lateness_ns) < 100


def test_garbage_is_a_lost_clock() -> None:
    bench = Bench(lambda t: t if t < 20 else (t * 7919) % 1000)
    bench.run(25)
    assert (bench.discipline.state, bench.discipline.jumps) == ("lost", 0)


def test_a_clock_that_never_answered_is_lost_and_changes_nothing() -> None:
    bench = Bench(lambda t: None)
    bench.run(3)
    assert (bench.discipline.state, set(bench.rates)) == ("lost", {0.0})


def test_a_long_period_has_a_longer_interval() -> None:
    options = DisciplineOptions(period_ns=10**9)
    assert (options.interval, options.time_constant) == (2.0, 20.0)

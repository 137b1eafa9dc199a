"""Ten drives, then thirty-three, whose crystals differ by up to 200 ppm from each other, drift with
the temperature, and whose differences are read within a microsecond. Two seconds after the loop was
entered, its burst included, no clock is further than a microsecond from the reference; and none is
for long after. (`python -m benchmarks clocks` runs ten minutes of it.)"""

from __future__ import annotations

from random import Random

import pytest

import catenary as cat
from catenary.virtual import Crystal, Junction, Servo
from tests.scenario.cell import cell_of
from tests.scenario.clocked import clocked_cell, crystal, run_for, true_differences

BOUND = 1e-6


@pytest.mark.parametrize("servos", [10, 33])
def test_within_two_seconds_and_for_long_after(servos: int) -> None:
    with clocked_cell(servos) as cell:
        entered = cell.segment.now_ns
        with cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
            loop.wait_locked(within=BOUND, timeout=2.0)
            assert cell.segment.now_ns - entered < 2e9
            worst = 0.0
            for _ in range(200):
                run_for(loop, 0.02)
                found = true_differences(cell.segment)
                worst = max(worst, *map(abs, found.values()))
            assert len(found) == servos
            assert worst < BOUND
            assert loop.clocks.locked
            assert loop.clocks.reference is cell.subs[0]


def test_with_stamps_that_scatter_twice_as_much() -> None:
    """The clocks follow what they read, so they scatter too; what is watched is a mean."""
    with clocked_cell(10, jitter=1e-6) as cell, cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
        loop.wait_locked(within=BOUND, timeout=2.0)
        for _ in range(50):
            run_for(loop, 0.02)
            assert loop.clocks.locked
            found = true_differences(cell.segment).values()
            assert max(map(abs, found)) < 1.5e-6
            assert sum(d * d for d in found) / len(found) < 0.5e-6**2


@pytest.mark.parametrize("run", ["threaded", "inline"])
@pytest.mark.parametrize("clock", ["reference", "main"])
def test_whoever_follows_in_whatever_order(run: str, clock: str) -> None:
    with clocked_cell(3) as cell:
        arm = cell.drives(dc=True)
        with cat.Loop(arm, period=1e-3, execution=run, clocks=cat.ClockOptions(lead=clock)) as loop:  # type: ignore[arg-type]
            loop.wait_locked(within=BOUND, timeout=2.0)
            run_for(loop, 0.5)
            assert all(abs(d) < BOUND for d in true_differences(cell.segment).values())
            assert abs(loop.clocks.phase_error) < BOUND
            assert loop.clocks.jumps == 0


def test_over_branches_the_delays_are_right() -> None:
    """A tree, clocks without scatter: what is left is what the delays are wrong by."""
    random = Random(4)
    servos = [Servo(serial=k, crystal=crystal(random, 0.0)) for k in range(6)]
    behind = {1: (0, 3), 2: (1, 1), 3: (0, 1), 4: (3, 1), 5: (0, 2), 6: (5, 1)}
    with (
        cell_of(Junction(), *servos, behind=behind) as cell,
        cat.Loop(cell.drives(dc=True), period=1e-3) as loop,
    ):
        loop.wait_locked()
        run_for(loop, 16.0)  # four times what the controllers' own filters take
        found = true_differences(cell.segment)
    assert len(found) == 6
    assert max(map(abs, found.values())) < 50e-9


def test_the_wake_up_takes_on_the_reference_clocks_rate() -> None:
    with cell_of(Servo(crystal=Crystal(ppm=150.0))) as cell:
        with cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
            run_for(loop, 1.0)
            assert loop.clocks.rate == pytest.approx(150e-6, abs=1e-6)
            period = loop.timing["period"]["mean"]
        assert period == pytest.approx(1e-3 / (1 + 150e-6), rel=5e-6)  # of the machine


def test_the_reference_takes_on_the_machines_rate() -> None:
    with (
        cell_of(Servo(crystal=Crystal(ppm=150.0)), Servo(crystal=Crystal(ppm=-80.0))) as cell,
        cat.Loop(cell.drives(dc=True), period=1e-3, clocks=cat.ClockOptions(lead="main")) as loop,
    ):
        loop.wait_locked()
        offset = cell.segment.core.system_time(0) - cell.segment.now_ns
        run_for(loop, 2.0)
        assert abs(cell.segment.core.system_time(0) - cell.segment.now_ns - offset) < 500


def test_a_law_runs_by_the_reference_clock_too() -> None:
    def hold(actual, target, memory, time):  # type: ignore[no-untyped-def]
        return time > 0.3

    with clocked_cell(2) as cell, cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
        loop.wait_locked()
        loop.run(hold)
        assert loop.clocks.locked
        assert all(abs(d) < BOUND for d in true_differences(cell.segment).values())

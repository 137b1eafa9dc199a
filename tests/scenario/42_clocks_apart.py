"""A crystal warms up faster than its controller follows: an event says whose clock left the bound,
and another when it is back. Asking for more than the clocks can give ends with an error that names
the worst. The axes follow all the while: a clock that is off is no fault of the bus."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.bus.event_types import ClockLocked, ClockUnlocked
from catenary.errors import ClockError
from catenary.virtual import Coupler, Crystal, Servo
from tests.scenario.cell import cell_of
from tests.scenario.clocked import clocked_cell, run_for


def test_leaving_the_bound_and_coming_back_are_events() -> None:
    with cell_of(Coupler(), Servo(serial=1), Servo(serial=2)) as cell:
        with cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
            loop.wait_locked(within=0.5e-6)
            list(cell.main.events)
            cell.segment[2].crystal = Crystal(ppm=450.0)
            run_for(loop, 1.0)
            cell.segment[2].crystal = Crystal(ppm=440.0)
            run_for(loop, 8.0)
            events = [e for e in cell.main.events if isinstance(e, ClockLocked | ClockUnlocked)]
        kinds = [type(event) for event in events]
        assert kinds == [ClockUnlocked, ClockLocked]
        left = events[0]
        assert isinstance(left, ClockUnlocked)
        assert left.sub is cell.subs[2]
        assert left.difference > left.bound == pytest.approx(0.5e-6)
        assert "device 2" in left.message


def test_more_than_clocks_can_give() -> None:
    with clocked_cell(2) as cell, cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
        with pytest.raises(ClockError, match=r"clocks not within 0.01 us after 0.5 s: .* us off"):
            loop.wait_locked(within=1e-8, timeout=0.5)
        loop.wait_locked(within=1e-6)  # the loop goes on


@pytest.mark.parametrize("within", [0.0, -1e-6, float("nan")])
def test_a_bound_is_positive(within: float) -> None:
    with (
        clocked_cell(1) as cell,
        cat.Loop(cell.drives(dc=True), period=1e-3) as loop,
        pytest.raises(ValueError, match="must be positive"),
    ):
        loop.wait_locked(within=within)


def test_the_figures_print() -> None:
    with clocked_cell(2) as cell, cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
        loop.wait_locked()
        text = str(loop.clocks)
        assert "clocks locked within 1 us; reference: device 0 (Catenary virtual coupler)" in text
        assert "device 3 (Catenary virtual servo): " in text
        assert set(loop.clocks.differences) == {2, 3}
        assert set(loop.clocks.largest_differences) == {2, 3}
        assert loop.clocks.missed == 0
        before = loop.clocks.time
        run_for(loop, 0.1)
        assert loop.clocks.time - before == pytest.approx(0.1, abs=2e-3)


def test_late_frames_are_late_and_not_corrupt() -> None:
    """Each cycle asks another device's difference: a frame of the cycle before looks different."""
    with (
        clocked_cell(2) as cell,
        cat.Loop(cell.drives(dc=True), stop=cat.StopPolicy(lost_limit=5)) as loop,
    ):
        loop.wait_locked()
        cell.spoil("delay", 2, delay=1.2e-3)
        run_for(loop, 0.02)
        assert loop.timing.counters["stale"] == 2
        assert loop.timing.counters["corrupt"] == 0
        assert loop.clocks.missed == 2

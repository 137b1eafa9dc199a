"""A crystal warms up faster than its controller can follow. Events report that its clock left the
bound, and that it returned. A bound that the clocks cannot keep ends with an error that names the
worst clock. The axes keep moving, because a clock error is not a bus fault.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.bus.event_types import ClockLocked, ClockUnlocked
from catenary.errors import ClockError
from catenary.virtual import Coupler, Crystal, Servo
from tests.scenario.cell import cell_of
from tests.scenario.clocked import clocked_cell, run_for


def test_leaving_the_bound_and_returning_are_events() -> None:
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


def test_a_bound_that_the_clocks_cannot_keep() -> None:
    with clocked_cell(2) as cell, cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
        with pytest.raises(ClockError, match=r"clocks not within 0.01 us after 0.5 s: .* us off"):
            loop.wait_locked(within=1e-8, timeout=0.5)
        loop.wait_locked(within=1e-6)  # the loop continues


@pytest.mark.parametrize("within", [0.0, -1e-6, float("nan")])
def test_a_bound_is_positive(within: float) -> None:
    with (
        clocked_cell(1) as cell,
        cat.Loop(cell.drives(dc=True), period=1e-3) as loop,
        pytest.raises(ValueError, match="must be positive"),
    ):
        loop.wait_locked(within=within)


def test_the_figures_are_printed() -> None:
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


def test_late_frames_count_as_late_and_not_as_corrupt() -> None:
    """Each cycle reads the difference of another device, so a frame of the last cycle differs."""
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

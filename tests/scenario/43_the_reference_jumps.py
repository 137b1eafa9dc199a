"""The offset of the reference clock is overwritten, and its time jumps by 300 us. The other clocks
and the cycle follow as fast as they can, no pulse misses its outputs, and events report the jump.
A single wrong reading changes nothing. After a jump of many periods, the drives report missing
outputs, and the loop ends safely with their reason.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.bus.event_types import ClockLocked, ClockUnlocked
from catenary.errors import StateError
from tests.scenario.cell import Cell
from tests.scenario.clocked import clocked_cell, run_for, true_differences

OFFSET = 0x0920


def jump(cell: Cell, position: int, by_ns: int) -> None:
    core = cell.segment.core
    offset = int.from_bytes(core.peek(position, OFFSET, 8), "little")
    core.poke(position, OFFSET, ((offset + by_ns) % 2**64).to_bytes(8, "little"))


@pytest.mark.parametrize("by_ns", [-300_000, 300_000])
def test_the_cycle_starts_follow_as_fast_as_the_clocks(by_ns: int) -> None:
    with clocked_cell(2) as cell:
        arm = cell.drives(dc=True)
        with cat.Loop(arm, period=1e-3) as loop:
            loop.wait_locked()
            list(cell.main.events)
            jump(cell, 0, by_ns)
            run_for(loop, 3.0)
            assert loop.clocks.jumps == 1
            assert loop.clocks.locked
            assert loop.timing.counters["lost"] == 0
            events = [e for e in cell.main.events if isinstance(e, ClockLocked | ClockUnlocked)]
            assert [type(event) for event in events] == [ClockUnlocked, ClockLocked]
            assert all(abs(d) < 1e-6 for d in true_differences(cell.segment).values())
            assert cell.drive_states == ["OPERATION ENABLED"] * 2


def test_a_single_wrong_reading_is_ignored() -> None:
    with clocked_cell(2) as cell, cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
        loop.wait_locked()
        jump(cell, 0, 400_000)
        run_for(loop, 1e-3)
        jump(cell, 0, -400_000)
        run_for(loop, 0.5)
        assert loop.clocks.jumps == 0


def test_a_follower_that_jumps_returns_by_itself() -> None:
    with clocked_cell(2) as cell, cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
        loop.wait_locked()
        jump(cell, 3, 50_000)
        run_for(loop, 0.05)
        assert not loop.clocks.locked
        run_for(loop, 2.0)
        assert loop.clocks.locked
        assert loop.clocks.jumps == 0


def test_a_jump_that_no_drive_can_follow_ends_the_loop() -> None:
    with clocked_cell(2) as cell:
        with (
            pytest.raises(StateError, match="Synchronization error"),
            cat.Loop(cell.drives(dc=True), period=1e-3) as loop,
        ):
            loop.wait_locked()
            jump(cell, 0, -20_000_000)
            run_for(loop, 10.0)
        cell.assert_safe()

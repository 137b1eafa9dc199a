"""Drives with SYNC0 need new outputs before every pulse, and count missing ones.
The frame is sent before the pulse in every execution mode, and no pulse misses its outputs.
If the pulse is shifted before the frame, the drive takes the outputs of the previous cycle.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.types import UINT
from catenary.virtual import Coupler, Crystal, Servo
from tests.scenario.cell import Cell, cell_of
from tests.scenario.clocked import clocked_cell, run_for

MISSED_EVENTS = (0x1C32, 0x0B)  # pulses without new outputs


def missed(cell: Cell) -> list[int]:
    return [sub.sdo.read(*MISSED_EVENTS, type=UINT) for sub in cell.subs.drives]


@pytest.mark.parametrize("run", ["threaded", "inline"])
@pytest.mark.parametrize("clock", ["reference", "main"])
def test_no_pulse_misses_its_outputs(run: str, clock: str) -> None:
    with clocked_cell(2) as cell:
        arm = cell.drives(dc=True)
        with cat.Loop(arm, period=1e-3, execution=run, clocks=cat.ClockOptions(lead=clock)) as loop:  # type: ignore[arg-type]
            before = [cell.segment.core.synchronous(p)[2] for p in (2, 3)]
            pulses = cell.segment.core.pulses(2)[0]
            run_for(loop, 1.0)
            assert [cell.segment.core.synchronous(p)[2] for p in (2, 3)] == before
            assert cell.segment.core.pulses(2)[0] - pulses == pytest.approx(1000, abs=2)
            assert cell.drive_states == ["OPERATION ENABLED"] * 2


@pytest.mark.parametrize("shift", [-300e-6, -50e-6, 300e-6])
def test_a_shifted_pulse_misses_no_outputs(shift: float) -> None:
    with clocked_cell(2) as cell:
        arm = cell.drives(dc=cat.DistributedClock(shift=shift))
        with cat.Loop(arm, period=1e-3) as loop:
            before = [cell.segment.core.synchronous(p)[2] for p in (2, 3)]
            run_for(loop, 0.5)
            assert [cell.segment.core.synchronous(p)[2] for p in (2, 3)] == before


def test_drives_with_sync0_follow_a_sine() -> None:
    """They follow like drives without clocks."""
    import math

    with clocked_cell(2) as cell:
        arm = cell.drives(dc=True)
        with cat.Loop(arm, period=1e-3) as loop:
            home = arm.actual.position.copy()
            worst = 0.0
            for cycle in loop:
                arm.target.position[:] = home + 0.5 * math.sin(2 * cycle.time)
                worst = max(worst, float(abs(arm.actual.position - arm.target.position).max()))
                if cycle.time > 2.0:
                    break
            assert worst < 0.02
        cell.assert_safe()


def test_clocks_of_32_and_64_bits() -> None:
    with (
        cell_of(
            Coupler(crystal=Crystal(ppm=30)),
            Servo(serial=1, clock_bits=32, crystal=Crystal(ppm=-60)),
            Servo(serial=2, crystal=Crystal(ppm=60)),
        ) as cell,
        cat.Loop(cell.drives(dc=True), period=1e-3) as loop,
    ):
        loop.wait_locked(timeout=2.0)
        before = [cell.segment.core.synchronous(p)[2] for p in (1, 2)]
        run_for(loop, 5.0)  # 32 bits wrap every 4.3 s
        assert loop.clocks.locked
        assert [cell.segment.core.synchronous(p)[2] for p in (1, 2)] == before


def test_a_reference_clock_of_32_bits() -> None:
    with (
        cell_of(
            Servo(serial=1, clock_bits=32, crystal=Crystal(ppm=50)),
            Servo(serial=2, crystal=Crystal(ppm=-60)),
        ) as cell,
        cat.Loop(cell.drives(dc=True), period=1e-3) as loop,
    ):
        loop.wait_locked(timeout=2.0)
        run_for(loop, 5.0)
        assert loop.clocks.locked
        assert loop.clocks.jumps == 0


def test_without_a_request_drives_use_free_run() -> None:
    with clocked_cell(2) as cell, cat.Loop(cell.drives(), period=1e-3) as loop:
        run_for(loop, 0.1)
        assert cell.segment.core.pulses(2) == (0, 0)
        with pytest.raises(RuntimeError, match="no distributed clocks"):
            _ = loop.clocks


def test_a_loop_without_clocks_after_one_with() -> None:
    """The SYNC signals of the first loop do not affect the second."""
    with clocked_cell(2) as cell:
        with cat.Loop(cell.drives(dc=True), period=1e-3) as loop:
            run_for(loop, 0.1)
        pulses = cell.segment.core.pulses(2)[0]
        with cat.Loop(cell.drives(), period=1e-3) as loop:
            run_for(loop, 0.1)
        assert cell.segment.core.pulses(2)[0] - pulses < 200  # pulses before the deactivation

"""Frames of the cycle are lost, or return too late.
Two consecutive losses are only counted: the last inputs stay valid, and the motion continues.
Three consecutive losses end the loop with an error and its log, and all drives stop.
"""

import math

import numpy as np
import pytest

import catenary as cat
from catenary.errors import WorkingCounterError
from tests.scenario.cell import Cell

RUNS = ("threaded", "inline")


def sine(arm: cat.Drives, home: np.ndarray, time: float) -> None:
    arm.target.position[:] = home + 0.2 * math.sin(2 * math.pi * time)


@pytest.mark.parametrize("run", RUNS)
def test_two_lost_cycles_are_counted_and_the_motion_continues(cell: Cell, run: str) -> None:
    arm = cell.drives()
    seen = []
    with cat.Loop(arm, execution=run) as loop:  # type: ignore[arg-type]
        home = arm.actual.position.copy()
        for cycle in loop:
            if cycle.number == 100:
                cell.spoil("lose", 2)
            sine(arm, home, cycle.time)
            seen.append((cycle.ok, cycle.lost, arm.actual.position[0]))
            if cycle.number == 200:
                break
        assert loop.timing.counters["lost"] == 2
    bad = [k for k, (ok, _, _) in enumerate(seen) if not ok]
    assert len(bad) == 2
    assert [seen[k][1] for k in bad] == [1, 2]
    assert seen[bad[0]][2] == seen[bad[1]][2] == seen[bad[0] - 1][2]  # the last good inputs
    assert seen[bad[1] + 1][2] != seen[bad[1]][2]
    cell.assert_safe()


@pytest.mark.parametrize("run", RUNS)
def test_three_consecutive_losses_end_the_loop_with_its_log(cell: Cell, run: str) -> None:
    arm = cell.drives()
    with (
        pytest.raises(WorkingCounterError, match="3 cycles in a row") as caught,
        cat.Loop(arm, execution=run) as loop,  # type: ignore[arg-type]
    ):
        home = arm.actual.position.copy()
        for cycle in loop:
            if cycle.number == 100:
                cell.spoil("lose", 3)
            sine(arm, home, cycle.time)
            assert cycle.number < 120
    log = caught.value.log
    assert log is not None
    assert log["lost_in_row"][-1] == 3  # type: ignore[index]
    assert "frames are lost" in caught.value.hint  # every device answers a separate request
    cell.assert_safe()


def test_a_late_frame_counts_as_lost(cell: Cell) -> None:
    arm = cell.drives()
    with cat.Loop(arm) as loop:
        for cycle in loop:
            if cycle.number == 50:
                cell.spoil("delay", 1, delay=3e-3)
            if cycle.number == 100:
                break
        counters = loop.timing.counters
    assert counters["lost"] == 1
    assert counters["stale"] == 1  # it arrived late, and counts as stale
    cell.assert_safe()


def test_one_lost_cycle_ends_a_loop_with_a_limit_of_one(cell: Cell) -> None:
    arm = cell.drives()
    with (
        pytest.raises(WorkingCounterError, match="1 cycles"),
        cat.Loop(arm, stop=cat.StopPolicy(lost_limit=1)) as loop,
    ):
        for cycle in loop:
            if cycle.number == 10:
                cell.spoil("lose", 1)
            assert cycle.number < 20
    cell.assert_safe()

"""The loop runs in the background, and the program that updates its targets is stuck. CSP holds,
CSV decelerates 0.2 s after the last update and holds, CST stops quickly after 20 ms and the brake
closes. Nothing moves on, whether the thread of the loop still repeats the targets or is stuck, too.
"""

from __future__ import annotations

import numpy as np
import pytest

import catenary as cat
from catenary.core import Engine
from catenary.plan.stop_reason import StopReason
from tests.scenario.vertical import (
    LAG,
    LOAD,
    MS,
    RESOLUTION,
    Trace,
    VerticalCell,
    vertical_cell,
)

TIMEOUT_TORQUE, TIMEOUT, KEEP = 0.020, 0.200, 0.010  # s
REACTION = 2 * MS  # the frame of the quick stop, and its effect
DECELERATION = 10.0  # rad/s²
STUCK = {"it_repeats": True, "its_thread_is_stuck_too": False}


def in_background(loop: cat.Loop) -> Engine:
    """Set the core as `run_in_background` does; the test stands for its thread, in virtual time."""
    engine = loop.networks[0].session.engine
    next(loop)
    engine.background = True
    return engine


def update(
    cell: VerticalCell, arm: cat.Drives, loop: cat.Loop, cycles: int, velocity: float
) -> cat.Cycle:
    """Update the targets in every cycle, as `with loop.update():` does."""
    engine = in_background(loop)
    for _ in range(cycles):
        engine.begin_update()
        arm.target.position[:] += velocity * MS
        arm.target.velocity[:] = velocity
        arm.target.torque[:] = cell.gravity
        engine.end_update(True)
        cycle = next(loop)
    return cycle


def stuck(cell: VerticalCell, cycle: cat.Cycle, loop: cat.Loop, *, repeats: bool) -> Trace:
    """Let a second pass without an update."""
    if not repeats:
        return cell.compute(cycle, 1.0)
    samples = []
    for _ in range(1000):
        next(loop)
        samples.append(cell.sample())
    return Trace(samples)


@pytest.mark.parametrize("repeats", STUCK.values(), ids=STUCK)
@pytest.mark.parametrize("torque", [LOAD, 15.0])
def test_cst_stops_20_ms_after_the_last_update(torque: float, repeats: bool) -> None:
    """Bound: the way with the kept torque, the drive's ramp, the fall until the brake closes."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            cycle = update(cell, arm, loop, 200, 0.0)
            engine = loop.networks[0].session.engine
            engine.begin_update()
            arm.target.torque[:] = torque
            engine.end_update(True)
            next(loop)
            before, downwards = cell.joint, -cell.velocity
            trace = stuck(cell, cycle, loop, repeats=repeats)
            next(loop)
            assert arm.stopped == (StopReason.COMMAND_TIMEOUT,)
        assert trace.torque[:19] == pytest.approx(torque, abs=0.1)
        kept = cell.kept_torque(torque, TIMEOUT_TORQUE + REACTION, downwards)
        assert trace.fall(before) < kept.ramp_bound() + cell.fall_bound() + RESOLUTION


@pytest.mark.parametrize("repeats", STUCK.values(), ids=STUCK)
@pytest.mark.parametrize("velocity", [-0.5, 0.5])
def test_csv_decelerates_200_ms_after_the_last_update_and_holds(
    velocity: float, repeats: bool
) -> None:
    """Bound: v · 200 ms, v² / 2a of the deceleration, the drive's lag."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="csv", velocity_limit=2.0, deceleration_limit=DECELERATION)
        with cat.Loop(arm) as loop:
            cycle = update(cell, arm, loop, 400, velocity)
            assert cell.velocity == pytest.approx(velocity, abs=0.02)
            before = cell.joint
            trace = stuck(cell, cycle, loop, repeats=repeats)
            next(loop)
            assert arm.stopped == (None,)
        assert trace.powered.all()
        speed = abs(velocity)
        way = speed * (TIMEOUT + REACTION + LAG) + speed**2 / (2 * DECELERATION)
        moved = (trace.joint - before) * np.sign(velocity)
        assert speed * (TIMEOUT - REACTION) < moved.max() < way + RESOLUTION
        assert abs(trace.joint[-1] - trace.joint[500]) < RESOLUTION


def test_pv_ends_200_ms_after_the_last_update_and_holds() -> None:
    """Bound: v · 200 ms, the drive's ramp 0x6084 of 10 rad/s², the lag."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="pv", velocity_limit=2.0)
        with cat.Loop(arm) as loop:
            cycle = update(cell, arm, loop, 400, 0.5)
            before = cell.joint
            trace = stuck(cell, cycle, loop, repeats=True)
        assert trace.powered.all()
        way = 1.1 * 0.5 * (TIMEOUT + REACTION + LAG) + 0.55**2 / 20.0
        assert 0.5 * (TIMEOUT - REACTION) < trace.joint.max() - before < way + RESOLUTION
        assert abs(trace.velocity[-1]) < 1e-3


def test_csp_holds_without_limit_while_its_thread_is_stuck() -> None:
    """Bound: v · 10 ms, v² / 2a of the deceleration, the lags of the loops."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="csp", velocity_limit=2.0, deceleration_limit=DECELERATION)
        with cat.Loop(arm) as loop:
            cycle = update(cell, arm, loop, 400, -0.5)
            before = cell.joint
            trace = cell.compute(cycle, 3.0)
            next(loop)
            assert arm.stopped == (None,)
        assert trace.powered.all()
        way = 0.5 * (KEEP + MS) + 0.5**2 / (2 * DECELERATION) + 0.5 * (LAG + 0.010)
        assert trace.fall(before) < way + RESOLUTION
        assert abs(trace.joint[-1] - trace.joint[1000]) < 1e-4

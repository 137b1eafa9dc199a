"""The application is late, or its stream is empty. CST keeps its torque for 10 ms, CSV decelerates,
CSP goes on for 10 ms and decelerates. After the late limit the drive stops quickly and the brake
closes: the arm falls no further than the brake's time allows.
"""

from __future__ import annotations

import numpy as np
import pytest

import catenary as cat
from catenary.plan.stop_reason import StopReason
from tests.scenario.vertical import (
    LAG,
    LOAD,
    MS,
    RESOLUTION,
    Trace,
    VerticalCell,
    follow,
    until_taken,
    vertical_cell,
)

LATE_TORQUE, LATE, KEEP = 0.010, 0.050, 0.010  # s
REACTION = 2 * MS  # the frame of the quick stop, and its effect
DECELERATION = 10.0  # rad/s²


def late_in_cst(cell: VerticalCell, torque: float, **options: object) -> tuple[Trace, float, float]:
    """Let the application be late for a second with `torque` [N·m] at the joint.

    Returns the trace, and angle [rad] and velocity downwards [rad/s] before.
    """
    arm = cell.drives(mode="cst", velocity_limit=6.0)
    with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event"), **options) as loop:  # type: ignore[arg-type]
        cycle = follow(cell, arm, loop, 100)
        arm.target.torque[:] = torque
        next(loop)
        before, downwards = cell.joint, -cell.velocity
        trace = cell.compute(cycle, 1.0)
        next(loop)
        assert arm.stopped == (StopReason.UNDERRUN,)
    return trace, before, downwards


@pytest.mark.parametrize("torque", [LOAD, 15.0, 35.0])
def test_a_late_commit_in_cst(torque: float) -> None:
    """Bound: the way with the kept torque, the drive's ramp, the fall until the brake closes."""
    with vertical_cell() as cell:
        trace, before, downwards = late_in_cst(cell, torque)
        assert trace.torque[:9] == pytest.approx(torque, abs=0.1)
        if torque == LOAD:
            assert LATE_TORQUE <= trace.powered_ms * MS <= LATE_TORQUE + REACTION
        kept = cell.kept_torque(torque, LATE_TORQUE + REACTION, downwards)
        assert trace.fall(before) < kept.ramp_bound() + cell.fall_bound() + RESOLUTION


def test_the_late_limit_is_at_least_three_cycles() -> None:
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event"), period=8e-3) as loop:
            cycle = follow(cell, arm, loop, 50)
            before = cell.joint
            trace = cell.compute(cycle, 1.0)
        assert 24 <= trace.powered_ms <= 24 + 2 * 8
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION


def test_an_empty_stream_in_cst() -> None:
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            follow(cell, arm, loop, 100)
            stream = loop.stream()
            stream.write(torque=[[cell.gravity]] * 50)
            cycle = until_taken(loop, stream, 50)
            before = cell.joint
            trace = cell.compute(cycle, 1.0)
            next(loop)
            assert arm.stopped == (StopReason.UNDERRUN,)
        assert LATE_TORQUE <= trace.powered_ms * MS <= LATE_TORQUE + REACTION
        assert trace.fall(before) < cell.fall_bound() + RESOLUTION


@pytest.mark.parametrize("stream", [False, True])
@pytest.mark.parametrize(("mode", "keep"), [("csp", KEEP), ("csv", 0.0)])
@pytest.mark.parametrize("velocity", [-0.5, 0.5])
def test_csp_and_csv_decelerate_and_stop(
    mode: str, keep: float, velocity: float, stream: bool
) -> None:
    """Bound: v · 10 ms in CSP, v² / 2a of the deceleration, the drive's lag, the fall until the
    brake has closed."""
    with vertical_cell() as cell:
        arm = cell.drives(mode=mode, velocity_limit=2.0, deceleration_limit=DECELERATION)
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            cycle = follow(cell, arm, loop, 100)
            if stream:
                rows = 300 * [[velocity]]
                path = arm.target.position + velocity * MS * np.arange(1, 301)[:, None]
                stream_of = loop.stream()
                stream_of.write(path, velocity=rows)
                cycle = until_taken(loop, stream_of, 300)
            else:
                cycle = follow(cell, arm, loop, 300, velocity)
            assert cell.velocity == pytest.approx(velocity, abs=0.02)
            before = cell.joint
            trace = cell.compute(cycle, 1.0)
            next(loop)
            assert arm.stopped == (StopReason.UNDERRUN,)
        assert LATE <= trace.powered_ms * MS <= LATE + 5 * MS
        speed = abs(velocity)
        lag = LAG + (0.010 if mode == "csp" else 0.0)  # 1 / position gain
        way = speed * (keep + MS) + speed**2 / (2 * DECELERATION) + speed * lag
        below = max(way if velocity < 0 else 0.0, 0.0) + cell.fall_bound() + RESOLUTION
        assert trace.fall(before) < below
        assert trace.joint.max() - before < (way if velocity > 0 else 0.0) + RESOLUTION


def test_the_late_limit_cannot_be_switched_off_in_cst() -> None:
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with (
            pytest.raises(ValueError, match="late_limit=0 is refused"),
            cat.Loop(arm, stop=cat.StopPolicy(late_limit=0)),
        ):
            pass
        assert cell.fall(0.0) < RESOLUTION

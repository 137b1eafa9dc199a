"""Limits come from the application and from the drive: the drive's own ones only tighten.
CSP has a default with a warning; CSV and CST require `velocity_limit`.
On a vertical axis the arm stays within them, whatever the application writes.
"""

from __future__ import annotations

import math

import pytest

import catenary as cat
from catenary.plan.stop_reason import StopReason
from catenary.virtual import ServoQuirks
from tests.scenario.vertical import GEAR, LAG, LOAD, MS, RAMP, RESOLUTION, follow, vertical_cell

SERVO_LAG = 0.010 + LAG  # s: position loop and velocity loop
TWO_CYCLES = 2 * MS  # s: from the axis to the core and back


def test_csp_without_a_velocity_limit_warns_and_moves_at_one_turn_per_second() -> None:
    """Bound: 2π rad/s and the overshoot of the drive."""
    with vertical_cell() as cell:
        with pytest.warns(UserWarning, match="no velocity_limit"):
            arm = cell.drives()
        fastest = 0.0
        with cat.Loop(arm) as loop:
            for cycle in loop:
                arm.target.position[:] = 20.0 * cycle.time**2  # up to 8.8 rad/s
                fastest = max(fastest, cell.velocity)
                if cycle.time > 0.22:
                    break
        assert 0.9 * 2 * math.pi < fastest < 1.2 * 2 * math.pi


@pytest.mark.parametrize(
    "options",
    [{"mode": "csv"}, {"mode": "cst"}, {"other_modes": ["csv"]}, {"other_modes": ["cst"]}],
)
def test_csv_and_cst_require_a_velocity_limit(options: dict[str, object]) -> None:
    with vertical_cell() as cell:
        with pytest.raises(ValueError, match="velocity_limit="):
            cell.drives(**options)
        cell.drives(**options, velocity_limit=6.0)


@pytest.mark.parametrize("option", [None, 1.0, 0.1])
def test_the_drives_position_limits_only_tighten(option: float | None) -> None:
    """Bound: the tighter one of 0.2 rad (0x607D) and the option."""
    with vertical_cell(position_limits=(-0.5 * GEAR, 0.2 * GEAR)) as cell:
        arm = cell.drives(velocity_limit=2.0, position_max=option)
        with cat.Loop(arm) as loop:
            printed = str(loop.plan)
            follow(cell, arm, loop, 800, 0.5)
            highest = cell.joint
        limit = min(0.2, option or math.inf)
        assert limit - RESOLUTION < highest < limit + RESOLUTION
        source = "option" if limit == option else "0x607D of the drive"
        assert f"to {limit:.4g} rad ({source})" in printed


def test_a_position_limit_in_csv_stops_the_arm_before_it() -> None:
    """Bound: the lag of the drive at the velocity limit."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="csv", velocity_limit=0.5, position_max=0.2)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 1000, 5.0)
            assert 0.15 < cell.joint < 0.2 + 0.5 * (LAG + TWO_CYCLES)


def test_a_position_limit_in_cst_is_a_quick_stop() -> None:
    """Bound: v² / 2a of 0x6085 and the lag beyond the limit; then the fall until the brake has
    closed."""
    with vertical_cell() as cell:
        arm = cell.drives(mode="cst", velocity_limit=2.0, position_max=0.2)
        highest, reached = 0.0, 0.0
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            for cycle in loop:
                arm.target.torque[:] = cell.gravity + 5.0
                reached = max(reached, cell.velocity)
                highest = max(highest, cell.joint)
                if cycle.number == 1000:
                    break
            assert arm.stopped == (StopReason.POSITION_LIMIT,)
        way = reached**2 / (2 * RAMP) + reached * (LAG + 2 * TWO_CYCLES)
        assert highest < 0.2 + way + RESOLUTION
        assert highest - cell.joint < cell.fall_bound() + RESOLUTION


def test_the_drives_torque_limit_is_printed_and_tightens() -> None:
    with vertical_cell(max_torque_ratio=0.8) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0, torque_limit=100.0)
        with cat.Loop(arm) as loop:
            assert "torque 40 N·m (0x6072 of the drive)" in str(loop.plan)
            follow(cell, arm, loop, 100)
            arm.target.torque[:] = 90.0
            for _ in range(3):
                cycle = next(loop)
                arm.target.torque[:] = 90.0
            assert cycle.limited
            assert cell.torque == pytest.approx(40.0, abs=0.1)


def test_an_implausible_limit_of_the_drive_is_not_used() -> None:
    """0x607D of 0 and 0: not set."""
    with vertical_cell(position_limits=(0.0, 0.0), quirks=ServoQuirks()) as cell:
        arm = cell.drives(velocity_limit=2.0)
        with cat.Loop(arm) as loop:
            assert "position from none to none" in str(loop.plan)
            follow(cell, arm, loop, 800, 0.5)
            assert cell.joint == pytest.approx(0.4, abs=0.02)
            assert cell.torque == pytest.approx(LOAD * math.cos(0.4), rel=0.1)

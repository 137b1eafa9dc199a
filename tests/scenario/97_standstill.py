"""A quick stop ends in QUICK STOP ACTIVE (0x605A = 6): the drive holds until its voltage is cut.
That happens at standstill: below 0.05 rad/s for 5 ms, whatever the velocity limit is.
On a vertical axis the arm then falls until the brake has closed.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.virtual import ServoQuirks
from tests.scenario.vertical import LAG, MS, RAMP, RESOLUTION, follow, vertical_cell

STANDSTILL = 0.05  # rad/s
EFFECT = 3 * MS  # the frame of the quick stop, and its effect


@pytest.mark.parametrize("velocity_limit", [2.0, 9.0])
@pytest.mark.parametrize("velocity", [-1.5, 1.5])
def test_the_voltage_is_cut_at_standstill(velocity: float, velocity_limit: float) -> None:
    """Bound: v² / 2a of 0x6085 and the drive's lag; then a fall that begins at standstill."""
    stays = ServoQuirks(quick_stop_option=6)
    with vertical_cell(quirks=stays) as cell:
        arm = cell.drives(mode="csv", velocity_limit=velocity_limit)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 200, velocity)
            arm.quick_stop()
            before = cell.joint
            held = cell.velocity
            fastest_without_torque = 0.0
            samples = []
            for _ in range(500):
                next(loop)
                samples.append(cell.sample())
                if cell.servo.drive_state() == "SWITCH ON DISABLED":
                    fastest_without_torque = abs(held)
                    break
                held = cell.velocity
            else:
                raise AssertionError("the voltage was never cut")
            follow(cell, arm, loop, 300)
            lowest = cell.joint
        assert fastest_without_torque < STANDSTILL
        way = velocity**2 / (2 * RAMP) + abs(velocity) * (EFFECT + LAG)
        assert abs(samples[-1].joint - before) < way + RESOLUTION
        fall = samples[-1].joint - lowest
        assert fall < cell.fall_bound(velocity=STANDSTILL) + RESOLUTION
        assert (velocity > 0) == (samples[-1].joint > before)


def test_at_rest_the_voltage_is_cut_within_10_ms() -> None:
    """5 ms of standstill, and the frames of quick stop and disable voltage with their effects."""
    with vertical_cell(quirks=ServoQuirks(quick_stop_option=6)) as cell:
        arm = cell.drives(velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 300)
            before = cell.joint
            arm.quick_stop()
            count = 0
            while cell.servo.drive_state() != "SWITCH ON DISABLED":
                next(loop)
                count += 1
                assert count <= 10
            assert abs(cell.fall(before)) < RESOLUTION
            follow(cell, arm, loop, 300)
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION

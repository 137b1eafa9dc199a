"""The drive determines the effect of a quick stop (0x605A): a ramp, torque off, or nothing.
The settings are read and printed. CST on a drive whose quick stop does not brake needs `on_loss=`.
Each reaction is a motion with its bound, after an application that is late in CST.
"""

from __future__ import annotations

from typing import Literal

import pytest

import catenary as cat
from catenary.errors import ConfigurationError
from catenary.plan.stop_reason import StopReason
from catenary.virtual import ServoQuirks
from tests.scenario.vertical import LAG, MS, RAMP, RESOLUTION, Kept, VerticalCell, follow
from tests.scenario.vertical import vertical_cell as rig

Option = int | Literal["absent"]

LATE = 0.010 + 2 * MS  # s: the late limit of CST, the frame of the stop and its effect
IGNORED = 0.020 + 2 * MS  # s: a quick stop without effect, then disable operation
SLOW_DOWN = RAMP / 2  # rad/s²: the servo's 0x6084, which 0x605C uses
POSITION_LOOP = 0.010  # s: the inverse of its gain
TORQUE = 15.0  # N·m at the joint: the arm sinks already


@pytest.mark.parametrize("option", [0, -1, "absent"])
def test_cst_needs_on_loss_if_a_quick_stop_does_not_brake(option: Option) -> None:
    with rig(quirks=ServoQuirks(quick_stop_option=option)) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with pytest.raises(ConfigurationError, match="0x605A") as caught, cat.Loop(arm):
            pass
        assert "on_loss" in caught.value.hint
        assert not cell.powered
        assert cell.fall(0.0) < RESOLUTION


@pytest.mark.parametrize("option", [0, -1, "absent"])
def test_csp_does_not_need_on_loss(option: Option) -> None:
    """Bound: without torque from the quick stop on, the fall until the brake has closed."""
    with rig(quirks=ServoQuirks(quick_stop_option=option)) as cell:
        arm = cell.drives(velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 300)
            before = cell.joint
        cell.let_pass(1.0)
        assert cell.fall(before) < cell.fall_bound() + RESOLUTION


def late(cell: VerticalCell, on_loss: str) -> tuple[float, float, int, float]:
    """Let the application be late for a second in CST.

    Returns the fall [rad], the velocity downwards before [rad/s], the time until the drive had left
    OPERATION ENABLED [ms], and the fall since half a second before the end [rad].
    """
    arm = cell.drives(mode="cst", velocity_limit=6.0, on_loss=on_loss)
    with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
        follow(cell, arm, loop, 100)
        arm.target.torque[:] = TORQUE
        next(loop)
        before, downwards = cell.joint, -cell.velocity
        trace = cell.compute(next(loop), 1.0)
        next(loop)
        assert arm.stopped == (StopReason.UNDERRUN,)
    return trace.fall(before), downwards, trace.powered_ms, trace.joint[500] - trace.joint[-1]


def bound_of(cell: VerticalCell, option: Option, on_loss: str, downwards: float) -> float:
    """Return the bound of the fall [rad]."""

    def kept(seconds: float) -> Kept:
        return cell.kept_torque(TORQUE, seconds + MS, downwards)

    if on_loss == "csp_hold":  # the mode changes, then the position loop catches the arm
        sinking = kept(LATE + 2 * MS)
        return sinking.way + sinking.velocity * (POSITION_LOOP + LAG)
    if on_loss == "disable":
        return kept(LATE).ramp_bound(SLOW_DOWN) + cell.fall_bound()
    if option == 0:
        return kept(LATE).way + cell.fall_bound(velocity=kept(LATE).velocity)
    if option == -1:
        return kept(LATE + IGNORED).ramp_bound(SLOW_DOWN) + cell.fall_bound()
    return kept(LATE).ramp_bound() + cell.fall_bound()


@pytest.mark.parametrize("option", [2, 0, -1, "absent"])
@pytest.mark.parametrize("on_loss", ["quick_stop", "disable", "csp_hold"])
def test_each_reaction_is_a_bounded_motion(option: Option, on_loss: str) -> None:
    with rig(quirks=ServoQuirks(quick_stop_option=option)) as cell:
        fall, downwards, powered, afterwards = late(cell, on_loss)
        assert fall < bound_of(cell, option, on_loss, downwards) + RESOLUTION
        assert abs(afterwards) < 1e-4  # brake or drive holds
        assert (powered == 1000) is (on_loss == "csp_hold")


def test_an_axis_that_holds_takes_its_load_over_again() -> None:
    with rig() as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0, on_loss="csp_hold")
        with cat.Loop(arm, stop=cat.StopPolicy(on_axis_stopped="event")) as loop:
            cell.compute(follow(cell, arm, loop, 100), 1.0)
            before = cell.joint
            arm.enable()
            follow(cell, arm, loop, 200)
            assert arm.enabled.all()
            assert arm.stopped == (None,)
            assert abs(cell.fall(before)) < RESOLUTION


def test_the_settings_of_the_drive_are_printed() -> None:
    with rig(quirks=ServoQuirks(quick_stop_option=-1, abort_connection_option=3)) as cell:
        arm = cell.drives(mode="cst", velocity_limit=60.0, on_loss="disable")
        with cat.Loop(arm) as loop:
            printed = str(loop.plan)
    for line in (
        "quick stop: manufacturer-specific (0x605A = -1)",
        "then disable the drive function (0x605C = 1)",
        "fault: slow down on the quick stop ramp (0x605E = 2)",
        "watchdog expired: quick stop (0x6007 = 3)",
        "deceleration 20 rad/s² (0x6085 of the drive)",
        "on_loss: disable",
    ):
        assert line in printed

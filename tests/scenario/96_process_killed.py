"""The process of a vertical axis is killed. The drive applies its last torque until the watchdog of
its outputs expires: 10 ms in CST by default. Its trigger bit is set for any content of the SII.
The drive determines the reaction (0x6007): a ramp, torque off, or nothing.
"""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.virtual import ServoQuirks
from tests.scenario.vertical import (
    LOAD,
    MS,
    RESOLUTION,
    Sample,
    Trace,
    VerticalCell,
    follow,
    vertical_cell,
)

SERVICE = 2 * MS  # the last frame, and from the watchdog to the drive's reaction
NO_ACTION, FAULT, DISABLE_VOLTAGE, QUICK_STOP = range(4)  # 0x6007


def kill(cell: VerticalCell, torque: float, **options: object) -> tuple[Trace, float, float]:
    """End the exchange in CST at once, as SIGKILL does.

    Returns the trace of a second, and angle [rad] and velocity downwards [rad/s] before.
    """
    arm = cell.drives(mode="cst", velocity_limit=6.0)
    with cat.Loop(arm, stop=cat.StopPolicy(raise_faults=False), **options) as loop:  # type: ignore[arg-type]
        follow(cell, arm, loop, 100)
        arm.target.torque[:] = torque
        next(loop)
        before, downwards = cell.joint, -cell.velocity
        loop._opened.engine.stop()
        samples: list[Sample] = []
        for _ in range(1000):
            cell.let_pass(MS)
            samples.append(cell.sample())
        loop._opened.engine.start()  # so that leaving finds what it expects
    return Trace(samples), before, downwards


@pytest.mark.parametrize("trigger", [True, False])
@pytest.mark.parametrize("checks", [True, False])
@pytest.mark.parametrize("torque", [LOAD, 15.0])
def test_the_watchdog_expires_with_any_sii(trigger: bool, checks: bool, torque: float) -> None:
    """Bound: the way with the kept torque, the drive's ramp, the fall until the brake closes."""
    quirks = ServoQuirks(watchdog_trigger=trigger, checks_watchdog=checks)
    with vertical_cell(quirks=quirks) as cell:
        trace, before, downwards = kill(cell, torque)
        if torque == LOAD:
            assert 9 <= trace.powered_ms <= 12
        kept = cell.kept_torque(torque, 0.010 + SERVICE + MS, downwards)
        assert trace.fall(before) < kept.ramp_bound() + cell.fall_bound() + RESOLUTION


@pytest.mark.parametrize("reaction", [FAULT, DISABLE_VOLTAGE, QUICK_STOP])
@pytest.mark.parametrize("watchdog", [0.010, 0.050])
def test_each_reaction_of_the_drive_is_a_bounded_motion(reaction: int, watchdog: float) -> None:
    """Bound: as above; without the ramp where the drive switches its voltage off."""
    with vertical_cell(quirks=ServoQuirks(abort_connection_option=reaction)) as cell:
        trace, before, downwards = kill(cell, 15.0, watchdog=watchdog)
        kept = cell.kept_torque(15.0, watchdog + SERVICE + MS, downwards)
        bound = kept.ramp_bound() + cell.fall_bound()
        if reaction == DISABLE_VOLTAGE:
            bound = kept.way + cell.fall_bound(velocity=kept.velocity)
        assert trace.fall(before) < bound + RESOLUTION
        assert not trace.powered[-1]


def test_a_drive_that_takes_no_action_is_printed() -> None:
    """No bound: such a drive applies its last torque forever. Write 1 to 3 to its 0x6007."""
    with vertical_cell(quirks=ServoQuirks(abort_connection_option=NO_ACTION)) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            assert "watchdog expired: no action (0x6007 = 0)" in str(loop.plan)
        trace, _, _ = kill(cell, LOAD)
        assert trace.powered.all()


def test_the_printed_watchdog_is_that_of_the_device() -> None:
    with vertical_cell(quirks=ServoQuirks(watchdog_trigger=False)) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            follow(cell, arm, loop, 20)
            assert "watchdog" in str(loop.plan)

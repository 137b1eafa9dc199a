"""A drive that never shows bit 12 of the statusword is enabled on a vertical axis.
The command is frozen where OPERATION ENABLED was reached: the arm does not follow its own sagging
position. After one second the drive is trusted without the bit.
"""

from __future__ import annotations

from pathlib import Path

import pytest

import catenary as cat
from catenary.virtual import ServoQuirks
from tests.scenario.frames import sent_to_axis
from tests.scenario.vertical import MS, RESOLUTION, follow, vertical_cell

NEVER = ServoQuirks(bit_12="never", follows_without_bit_12=True)
TRUST = 1.0  # s
ENABLE = 0x0F


@pytest.mark.parametrize("quirks", [ServoQuirks(), NEVER])
@pytest.mark.parametrize("start", [0.0, 0.4])
def test_the_arm_does_not_sag(quirks: ServoQuirks, start: float, tmp_path: Path) -> None:
    """Bound: the play of the drive's position loop while it takes the load over."""
    recording = tmp_path / "frames.pcapng"
    with vertical_cell(start=start, quirks=quirks, record=recording) as cell:
        arm = cell.drives(velocity_limit=2.0)
        lowest = start
        with cat.Loop(arm, enable=False) as loop:
            plan = loop.plan.cycle
            arm.enable()
            for cycle in loop:
                lowest = min(lowest, cell.joint)
                if cycle.number == 1500:
                    break
            assert arm.enabled.all()
            assert cell.powered
        assert start - lowest < RESOLUTION
    enabled = [each for each in sent_to_axis(recording, plan) if each.controlword == ENABLE]
    assert len(enabled) > 1400
    # the frame that enables is answered by the position that is held from then on
    assert len({each.position for each in enabled[5:]}) == 1


def test_a_drive_without_bit_12_is_trusted_after_one_second() -> None:
    with vertical_cell(quirks=NEVER) as cell:
        arm = cell.drives(velocity_limit=2.0)
        with cat.Loop(arm, enable=False) as loop:
            arm.enable()
            powered = enabled = 0
            for cycle in loop:
                powered = powered or (cycle.number if cell.powered else 0)
                if arm.enabled.all():
                    enabled = cycle.number
                    break
            assert (enabled - powered) * MS == pytest.approx(TRUST, abs=5 * MS)
            before = cell.joint
            follow(cell, arm, loop, 300, 0.5)
            assert cell.joint - before == pytest.approx(0.15, abs=0.02)


def test_in_cst_the_committed_torque_carries_the_load() -> None:
    """Bound: the fall of a few cycles between the brake and the torque: none, as it is sent before
    the brake opens."""
    with vertical_cell(quirks=NEVER) as cell:
        arm = cell.drives(mode="cst", velocity_limit=6.0)
        with cat.Loop(arm) as loop:
            lowest = 0.0
            for cycle in loop:
                arm.target.torque[:] = cell.gravity
                lowest = min(lowest, cell.joint)
                if cycle.number == 1500:
                    break
            assert arm.enabled.all()
        assert -lowest < RESOLUTION

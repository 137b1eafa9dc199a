"""The next target of a moving arm is beyond a limit, or too fast to stop before one.
Both errors name the axis and the limit before a row is written.
The current motion continues to its end, and the arm holds there, enabled.
"""

from __future__ import annotations

import numpy as np
import pytest

import catenary as cat
from catenary import control
from catenary.virtual import Coupler, Servo
from tests.scenario.cell import cell_of

LIMITS = control.MotionLimits(2.0, 10.0, 200.0, position_min=-1.0, position_max=1.0)


def test_the_arm_finishes_its_motion_and_holds() -> None:
    with cell_of(Coupler(), Servo(), Servo()) as cell:
        arm = cell.drives(mode="csp")
        with cat.Loop(arm, period=1e-3) as loop:
            home = arm.actual.position.copy()
            motion = control.trajectory(home, [0.8, -0.8], LIMITS, 1e-3)
            stream = loop.stream(len(motion))
            stream.write(motion.position)
            for _ in loop:
                if stream.taken == len(motion) // 2:
                    break
            with pytest.raises(
                ValueError, match=r"goal of axis 1 is -1\.2; it is beyond position_min"
            ):
                control.trajectory(arm.actual.position, [0.0, -1.2], LIMITS, 1e-3)
            fast = control.MotionState([0.95, 0.0], [1.9, 0.0])
            with pytest.raises(
                ValueError, match=r"highest position .* axis 0 is 1.* position_max 1"
            ):
                control.trajectory(fast, [0.0, 0.0], LIMITS, 1e-3)
            for cycle in loop:
                if stream.taken == len(motion):
                    stream.close()  # the end of the motion, not an underrun: the axes hold
                if cycle.number > len(motion) + 500:
                    break
            assert stream.taken == len(motion)
            assert arm.enabled.all()
            assert arm.actual.position == pytest.approx([0.8, -0.8], abs=1e-3)
            assert np.abs(arm.actual.velocity).max() < 0.05
        cell.assert_safe()

"""Trajectory streamed by a slower task: no commanded row exceeds a limit."""

import numpy as np
import pytest

import catenary as cat
from catenary import control

PERIOD = 1e-3
LIMITS = control.MotionLimits(velocity=[2.0, 1.0], acceleration=[8.0, 5.0], jerk=80.0)


def test_a_streamed_trajectory_keeps_all_limits_and_arrives() -> None:
    with cat.MainDevice(cat.Segment([cat.virtual.Servo(), cat.virtual.Servo()])) as main:
        arm = cat.Drives(
            main.scan().drives, mode="csp", counts_per_turn=2**20, velocity_limit=100.0
        )
        with cat.Loop(arm, period=PERIOD) as loop:
            home = arm.actual.position.copy()
            goal = home + np.array([1.0, -0.7])
            motion = control.trajectory(home, goal, LIMITS, PERIOD)
            stream, sent, rows, worst = loop.stream(capacity=40), 0, [home], 0.0
            for cycle in loop:
                if cycle.number % 10 == 0:  # the slower task: write as many rows as fit
                    part = motion.position[sent:], motion.velocity[sent:]
                    sent += stream.write(part[0], velocity=part[1]) if len(part[0]) else 0
                rows.append(arm.target.position.copy())
                worst = max(worst, abs(arm.actual.position - arm.target.position).max())
                if sent == len(motion) and cycle.dry:
                    break
    commanded = np.array(rows)
    assert commanded[-1] == pytest.approx(goal, abs=1e-8)  # one cycle was extrapolated
    begun = np.flatnonzero((commanded != home).any(axis=1))[0]
    ended = begun + len(motion)
    assert commanded[begun:ended] == pytest.approx(motion.position)  # no row lost or held
    padded = np.concatenate([np.tile(home, (3, 1)), commanded[begun:ended], np.tile(goal, (3, 1))])
    derivatives = [np.diff(padded, n=k, axis=0) / PERIOD**k for k in (1, 2, 3)]
    for found, limit in zip(
        derivatives, (LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk), strict=True
    ):
        assert (abs(found) <= np.array(limit) * (1 + 1e-6)).all()
    assert worst < 0.02  # delay of two cycles at 2 rad/s, plus the following error of the drives

"""A law of a cascade and of `Dynamics` holds the arm of examples/cobot against gravity."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import catenary as cat
from catenary import control

COBOT = Path(__file__).resolve().parents[2] / "examples" / "cobot"
GOAL = np.array([0.2, 0.5, -0.4, 0.3, 0.2, -0.1])


@cat.law
def hold(actual, target, memory, parameters):  # type: ignore[no-untyped-def]
    state, arm = control.part(memory, 0), control.part(memory, 1)
    gravity, goal = control.part(memory, 2), control.part(memory, 3)
    control.gravity(arm, actual.position, gravity)
    for i in range(actual.n):
        q, v = actual.position[i], actual.velocity[i]
        target.torque[i] = control.cascade(
            state, parameters, i, goal[i], 0.0, gravity[i], q, v, actual.dt
        )


def test_an_arm_is_held_at_its_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    monkeypatch.chdir(COBOT)
    joints = control.Cascade(
        position=control.Pid(6, 20.0, limit=2.6),  # [1/s], [rad/s]
        velocity=control.Pid(6, 40.0, integral=200.0, limit=[431, 431, 197, 79, 79, 79]),  # [N·m]
    )
    model = control.Dynamics("arm.xml", axes=6)
    with cat.MainDevice("virtual:segment.toml") as main:
        arm = cat.Drives(
            main.scan().drives,
            mode="cst",
            counts_per_turn=2**17,
            velocity_limit=100.0,
            gear_ratio=[121.0, 121.0, 121.0, 101.0, 101.0, 101.0],
            direction=[1, 1, -1, 1, -1, 1],
        )
        with cat.Loop(arm, period=1e-3, laws=[hold]) as loop:
            memory = control.join(joints.memory, model.memory, [0.0] * 6, GOAL)
            loop.start(hold, memory, joints.parameters)
            for cycle in loop:
                if cycle.number > 4000:
                    break
            assert arm.actual.position == pytest.approx(GOAL, abs=2e-3)
            assert abs(arm.actual.velocity).max() < 0.01
            assert abs(arm.actual.torque[1]) > 20.0  # holds against gravity

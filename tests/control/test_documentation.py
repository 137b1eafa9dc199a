"""The law of docs/how_to/control_blocks.md holds the arm of examples/cobot."""

import re
from pathlib import Path

import numpy as np
import pytest

import catenary as cat

ROOT = Path(__file__).resolve().parents[2]
COBOT = ROOT / "examples" / "cobot"


def test_the_first_example_holds_an_arm_at_its_goal(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba", reason="laws are compiled by Numba: pip install 'catenary[law]'")
    page = (ROOT / "docs/how_to/control_blocks.md").read_text()
    example = re.findall(r"```python\n(.*?)```", page, re.S)[0]
    goal = np.array([0.2, 0.5, -0.4, 0.3, 0.2, -0.1])
    monkeypatch.chdir(COBOT)
    with cat.MainDevice("virtual:segment.toml") as main:
        arm = cat.Drives(
            main.scan().drives,
            mode="cst",
            counts_per_turn=2**17,
            velocity_limit=100.0,
            gear_ratio=[121.0, 121.0, 121.0, 101.0, 101.0, 101.0],
            direction=[1, 1, -1, 1, -1, 1],
        )
        with cat.Loop(arm, period=1e-3) as loop:

            class Started:
                """Stand-in for the loop: start the law instead of running it to its end."""

                run = staticmethod(loop.start)

            exec(example, {"loop": Started, "goal": goal})
            for cycle in loop:
                if cycle.number > 4000:
                    break
            assert arm.actual.position == pytest.approx(goal, abs=2e-3)
            assert abs(arm.actual.velocity).max() < 0.01
            assert abs(arm.actual.torque[1]) > 20.0  # holds against gravity

"""Body of the loop without networks: what it decides without the safety task."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")
pytest.importorskip("numba", reason="laws need Numba: pip install 'catenary[law]'")
pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")

from exchange import COMMAND, SAFETY, Cause, Exchange, Verdict
from robot import BRAKE, BRING_UP, Robot

SILENCE = 5  # cycles


class NoShare:
    """Share without requests."""

    mode: str | None = None

    def requests(self) -> Sequence[Any]:
        return ()


@pytest.fixture
def x() -> Exchange:
    return Exchange()


@pytest.fixture
def robot(x: Exchange) -> Robot:
    sensors = SimpleNamespace(write=lambda state: None)
    return Robot([], sensors, x, NoShare(), SILENCE)


def step(robot: Robot, number: int, time: float) -> bool:
    return robot.step(SimpleNamespace(number=number, time=time))


def test_the_program_ends_if_it_is_not_ready_in_time(robot: Robot) -> None:
    assert step(robot, 1, BRING_UP)
    assert not step(robot, 2, BRING_UP + 1e-3)
    assert robot.operation.cause == Cause.NOT_READY


def test_in_damping_a_dead_safety_task_ends_the_program(robot: Robot, x: Exchange) -> None:
    x.command.write(np.zeros((), COMMAND))
    x.safety.write(np.zeros((), SAFETY))
    for number in range(SILENCE + 2):
        assert step(robot, number, number * 1e-3)
    assert robot.operation.verdict == Verdict.DAMP
    assert robot.operation.cause == Cause.SILENT_SAFETY
    assert not step(robot, 100, 1e-3 * SILENCE + BRAKE + 0.1)

"""Followers of the command topics."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from catenary.ros2.commands import State
from catenary.ros2.config import Trajectory
from catenary.ros2.followers import TrajectoryCommand
from tests.ros2.trajectories import JOINTS, limits, smooth

GOAL = np.array([0.1, 0.0])
RATTLE = np.array([0.05, -0.05])  # [rad/s] measured at rest


def state(commanded: Any) -> State:
    found: Any = SimpleNamespace(position=GOAL, velocity=RATTLE, commanded=commanded)
    result: State = found
    return result


@pytest.mark.parametrize(("tolerance", "ends"), [(0.0, True), (0.01, False)])
def test_a_noisy_velocity_counts_only_with_a_goal_tolerance(tolerance: float, ends: bool) -> None:
    command = TrajectoryCommand(JOINTS, limits(), Trajectory(goal_tolerance=tolerance))
    command.accept(smooth(1.0, *GOAL), 10.0, state(np.zeros(2)))
    assert command.sample(10.5, state(np.zeros(2))) is not None
    assert (command.sample(11.0, state(GOAL)) is None) == ends

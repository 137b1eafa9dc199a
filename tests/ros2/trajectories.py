"""Messages, states and limits for tests of trajectories, without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from catenary.ros2.goal import AxisStates
from catenary.ros2.limits import AxisLimits, Tolerances
from catenary.ros2.trajectory import FollowerOptions, TrajectoryFollower

JOINTS = ("a", "b")
STEP = 0.01  # [s]


def time_of(seconds: float) -> Any:
    nanoseconds = round(seconds * 1e9)
    return SimpleNamespace(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def point(
    time: float,
    positions: Sequence[float] = (),
    velocities: Sequence[float] = (),
    accelerations: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> Any:
    return SimpleNamespace(
        positions=positions,
        velocities=velocities,
        accelerations=accelerations,
        effort=effort,
        time_from_start=time_of(time),
    )


def trajectory(*points: Any, joints: Sequence[str] = JOINTS, stamp: float = 0.0) -> Any:
    header = SimpleNamespace(stamp=time_of(stamp), frame_id="")
    return SimpleNamespace(header=header, joint_names=list(joints), points=list(points))


def smooth(time: float, *positions: float, stamp: float = 0.0) -> Any:
    """Return a cubic trajectory to rest at `positions`."""
    return trajectory(point(time, positions, [0.0] * len(positions)), stamp=stamp)


def limits(**more: Any) -> AxisLimits:
    given = {"velocity": 2.0, "deceleration": 4.0, "position_min": -3.0, "position_max": 3.0}
    return AxisLimits.of(len(JOINTS), **{**given, **more})


def follower(
    tolerances: Tolerances | None = None, options: FollowerOptions | None = None, **more: Any
) -> TrajectoryFollower:
    return TrajectoryFollower(JOINTS, limits(**more), tolerances, options)


class Axes:
    """Owns two simulated axes that follow their set-points with an error, and the time."""

    def __init__(self, it: TrajectoryFollower, now: float = 100.0, error: float = 0.0) -> None:
        self.it, self.now, self.error = it, now, error
        self.commanded = np.zeros(len(JOINTS))
        self.velocity = np.zeros(len(JOINTS))
        self.positions: list[np.ndarray] = []
        self.velocities: list[np.ndarray] = []

    @property
    def state(self) -> AxisStates:
        return AxisStates(self.commanded + self.error, self.velocity, self.commanded)

    def accept(self, message: Any, tolerances: Tolerances | None = None) -> Any:
        return self.it.accept(message, self.now, self.state, tolerances)

    def run(self, duration: float) -> None:
        for _ in range(round(duration / STEP)):
            self.now += STEP
            self.commanded, self.velocity = self.it.sample(self.now, self.state)
            self.positions.append(self.commanded)
            self.velocities.append(self.velocity)

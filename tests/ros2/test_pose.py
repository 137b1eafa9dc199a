"""Motions to poses: straight, limited, refused and held by the stated rules."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from catenary.ros2.forward import CommandError
from catenary.ros2.goal import AxisStates
from catenary.ros2.kinematics import Kinematics, Pose
from catenary.ros2.limits import AxisLimits
from catenary.ros2.pose import PoseCommand, PoseOptions

ARM = Path(__file__).resolve().parents[2] / "examples" / "cobot" / "arm.xml"
BENT = np.array([0.1, 0.5, 1.2, 0.2, 1.2, 0.1])
STEP = 0.004  # [s]
FOREVER = PoseOptions(timeout=math.inf)


@pytest.fixture(scope="module")
def arm() -> Kinematics:
    return Kinematics(ARM, "tool", axes=6)


def limits(**more: Any) -> AxisLimits:
    return AxisLimits.of(6, **{"velocity": 2.0, "deceleration": 20.0, **more})


def message(position: Any, quaternion: Any = (1.0, 0.0, 0.0, 0.0), frame: str = "base_link") -> Any:
    w, x, y, z = quaternion
    point = SimpleNamespace(**dict(zip("xyz", position, strict=True)))
    pose = SimpleNamespace(position=point, orientation=SimpleNamespace(w=w, x=x, y=y, z=z))
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), pose=pose)


def moved(arm: Kinematics, *by: float, start: np.ndarray = BENT) -> Any:
    pose = arm.pose(start)
    return message(pose.position + np.array(by), pose.quaternion)


def state(position: np.ndarray = BENT) -> AxisStates:
    return AxisStates(position, np.zeros(6), position)


class Run:
    """Owns the time and the set-points of a motion."""

    def __init__(self, it: PoseCommand) -> None:
        self.it, self.now = it, 50.0
        self.rows: list[np.ndarray] = []
        self.error = ""

    def run(self, duration: float) -> None:
        for _ in range(round(duration / STEP)):
            self.now += STEP
            try:
                row = self.it.sample(self.now, state())
            except CommandError as error:
                self.error = error.message
                return
            if row is not None:
                self.rows.append(row)

    @property
    def velocities(self) -> np.ndarray:
        return np.diff(np.array([BENT, *self.rows]), axis=0) / STEP


def test_the_tool_moves_in_a_straight_line_and_arrives(arm: Kinematics) -> None:
    it = Run(PoseCommand(arm, limits(), FOREVER))
    it.it.accept(moved(arm, 0.05, -0.1, 0.0), it.now, state())
    it.run(3.0)
    begin = arm.pose(BENT)
    way = np.array([arm.pose(row).position for row in it.rows]) - begin.position
    direction = np.array([0.05, -0.1, 0.0]) / math.hypot(0.05, 0.1)
    aside = way - np.outer(way @ direction, direction)
    assert way[-1] == pytest.approx([0.05, -0.1, 0.0], abs=2e-4)
    assert abs(aside).max() < 1e-3
    last = arm.error(begin, arm.pose(it.rows[-1]))
    assert abs(last[3:]).max() < 2e-3


def test_the_speeds_are_limited(arm: Kinematics) -> None:
    it = Run(PoseCommand(arm, limits(), PoseOptions(linear_speed=0.05, timeout=math.inf)))
    it.it.accept(moved(arm, 0.0, 0.1, 0.0), it.now, state())
    it.run(3.0)
    positions = np.array([arm.pose(row).position for row in [BENT, *it.rows]])
    speeds = np.linalg.norm(np.diff(positions, axis=0), axis=1) / STEP
    assert speeds.max() == pytest.approx(0.05, rel=0.03)


def test_joint_velocities_and_accelerations_are_limited(arm: Kinematics) -> None:
    options = PoseOptions(linear_speed=5.0, angular_speed=20.0, timeout=math.inf)
    it = Run(PoseCommand(arm, limits(velocity=0.2, deceleration=2.0), options))
    it.it.accept(moved(arm, 0.0, 0.1, -0.05), it.now, state())
    it.run(4.0)
    assert abs(it.velocities).max() <= 0.2 + 1e-6
    assert abs(np.diff(it.velocities, axis=0)).max() <= 2.0 * STEP + 1e-6
    expected = arm.pose(BENT).position + np.array([0.0, 0.1, -0.05])
    assert arm.pose(it.rows[-1]).position == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize(
    ("command", "text"),
    [
        (message([3.0, 0, 1.0]), "out of reach"),
        (message([math.nan, 0, 1.0]), "not finite"),
        (message([0.3, 0, 1.0], [1.0, 1.0, 0, 0]), "norm 1.41421"),
        (message([0.3, 0, 1.0], [0.0, 0, 0, 0]), "norm 0"),
        (message([0.3, 0, 1.0], frame="camera"), "in the frame 'camera'"),
    ],
)
def test_bad_poses_are_refused(arm: Kinematics, command: Any, text: str) -> None:
    it = PoseCommand(arm, limits())
    with pytest.raises(CommandError, match=text):
        it.accept(command, 50.0, state())
    assert it.sample(50.01, state()) is None


def test_a_pose_beyond_the_limits_of_the_axes_is_refused(arm: Kinematics) -> None:
    it = PoseCommand(arm, limits(position_max=[3, 3, 1.25, 3, 3, 3], position_min=-3))
    with pytest.raises(CommandError, match="out of reach"):
        it.accept(moved(arm, -0.2, 0.0, -0.2), 50.0, state())


def test_a_lost_publisher_stops_the_arm_within_the_deceleration(arm: Kinematics) -> None:
    it = Run(PoseCommand(arm, limits(), PoseOptions(timeout=0.3)))
    it.it.accept(moved(arm, 0.0, 0.2, 0.0), it.now, state())
    it.run(2.0)
    assert it.error == "no message for 0.3 s"
    assert not it.it.active
    assert it.now == pytest.approx(50.3, abs=0.1)
    assert abs(np.diff(it.velocities, axis=0)).max() <= 20.0 * STEP + 1e-6


def test_after_the_arrival_the_time_out_only_ends_the_command(arm: Kinematics) -> None:
    it = Run(PoseCommand(arm, limits(), PoseOptions(timeout=3.0)))
    it.it.accept(moved(arm, 0.0, 0.02, 0.0), it.now, state())
    it.run(4.0)
    assert it.error == ""
    assert not it.it.active


def test_a_new_pose_continues_with_the_velocity(arm: Kinematics) -> None:
    it = Run(PoseCommand(arm, limits(), FOREVER))
    it.it.accept(moved(arm, 0.0, 0.2, 0.0), it.now, state())
    it.run(1.0)
    it.it.accept(moved(arm, 0.1, 0.1, 0.0), it.now, state())
    it.run(4.0)
    assert abs(np.diff(it.velocities, axis=0)).max() <= 20.0 * STEP + 1e-6
    expected = arm.pose(BENT).position + np.array([0.1, 0.1, 0.0])
    assert arm.pose(it.rows[-1]).position == pytest.approx(expected, abs=2e-4)


def test_the_arm_stops_before_a_singularity(arm: Kinematics) -> None:
    stretched = np.array([0.0, 0.8, 0.15, 0.0, 0.6, 0.0])  # the elbow is nearly straight
    nearly = stretched.copy()
    nearly[2] = 0.0
    pose = arm.pose(nearly)
    it = Run(PoseCommand(arm, limits(), FOREVER))
    it.it.accept(message(pose.position, pose.quaternion), it.now, state(stretched))
    it.run(10.0)
    assert "close to a singularity" in it.error
    assert abs(it.velocities[1:]).max() <= 2.0


class WithoutSolver(Kinematics):
    """Kinematics that accept every pose."""

    def solve(self, target: Pose, start: np.ndarray) -> np.ndarray:
        return start


def test_a_motion_against_a_joint_limit_stops_without_progress() -> None:
    start, beyond = BENT.copy(), BENT.copy()
    start[5], beyond[5] = 3.7, 3.9  # the limit of the last joint is 3.75
    arm = WithoutSolver(ARM, "tool", axes=6)
    pose = arm.pose(beyond)
    it = Run(PoseCommand(arm, limits(), FOREVER))
    it.it.accept(message(pose.position, pose.quaternion), it.now, state(start))
    it.run(5.0)
    assert "no progress" in it.error
    assert np.array(it.rows)[:, 5].max() <= arm.position_max[5]


@pytest.mark.parametrize("name", ["linear_speed", "angular_speed", "timeout"])
def test_options_must_be_positive(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        PoseOptions(**{name: 0.0})

"""Poses through the bridge: two virtual drives as a planar arm, in virtual time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from catenary.ros2.config import Commands, Config
from catenary.ros2.config import Pose as PoseConfig
from catenary.ros2.kinematics import Kinematics
from catenary.ros2.messages import Header, Point, Pose, PoseStamped, Quaternion
from tests.ros2.bridges import Rig, rig
from tests.ros2.planar import PLANAR

pytest.importorskip("mujoco", reason="kinematics need MuJoCo: pip install 'catenary[sim]'")

BENT = np.array([0.0, 0.8])


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "planar.xml"
    path.write_text(PLANAR)
    return path


def config(model: Path) -> Config:
    pose = PoseConfig(model=str(model), site="tip", linear_speed=0.5, angular_speed=2.0)
    return Config(commands=Commands(pose=pose))


def message(model: Path, joints: np.ndarray) -> PoseStamped:
    position, (w, x, y, z) = Kinematics(model, "tip").pose(joints)
    pose = Pose(Point(*position.tolist()), Quaternion(x=x, y=y, z=z, w=w))
    return PoseStamped(Header(frame_id="base_link"), pose)


def bend(it: Rig) -> None:
    """Move away from the straight arm, which is singular."""
    for _ in range(2000):
        it.arm.target.position[:] += np.clip(BENT - it.arm.target.position, -1e-3, 1e-3)
        next(it.loop)
    assert it.arm.actual.position == pytest.approx(BENT, abs=1e-3)


def test_a_stream_of_poses_moves_the_arm(model: Path) -> None:
    goal = np.array([0.2, 1.0])
    with rig(config(model)) as it:
        bend(it)

        def there() -> bool:
            it.backend.deliver("target_pose", message(model, goal))
            return bool(abs(it.arm.actual.position - goal).max() < 2e-3)

        assert it.until(there), it.last_report


def test_after_the_last_pose_the_arm_holds(model: Path) -> None:
    with rig(config(model)) as it:
        bend(it)
        it.backend.deliver("target_pose", message(model, np.array([1.5, 1.5])))
        it.step()
        assert it.until(lambda: "no message for 0.5 s" in it.last_report)
        stopped = it.arm.actual.position.copy()
        for _ in range(100):
            it.step()
        assert it.arm.actual.position == pytest.approx(stopped, abs=2e-3)
        assert abs(stopped - BENT).max() > 0.05


def test_a_pose_out_of_reach_is_refused(model: Path) -> None:
    with rig(config(model)) as it:
        bend(it)
        far = PoseStamped(Header(), Pose(Point(2.0, 0.0, 0.0), Quaternion()))
        it.backend.deliver("target_pose", far)
        assert it.until(lambda: "out of reach" in it.last_report)
        assert it.arm.actual.position == pytest.approx(BENT, abs=1e-3)

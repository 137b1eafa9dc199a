"""Kinematics of the cobot: pose, Jacobian and inverse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catenary.errors import ConfigurationError
from catenary.ros2.kinematics import Kinematics, Pose, condition, reached

ROOT = Path(__file__).resolve().parents[2]
ARM = ROOT / "examples" / "cobot" / "arm.xml"
BENT = np.array([0.1, 0.5, 0.8, 0.2, 0.4, 0.1])


@pytest.fixture(scope="module")
def arm() -> Kinematics:
    return Kinematics(ARM, "tool", axes=6)


def rotation(pose: Pose) -> Rotation:
    return Rotation.from_quat(np.roll(pose.quaternion, -1))


def test_upright_the_tool_is_above_the_base(arm: Kinematics) -> None:
    pose = arm.pose(np.zeros(6))
    assert pose.position[2] == pytest.approx(
        0.7 + 0.078 + 0.222 + 0.45 + 0.267 + 0.083 + 0.168 + 0.06
    )
    assert pose.quaternion == pytest.approx([1, 0, 0, 0])


def test_the_jacobian_equals_the_differences(arm: Kinematics) -> None:
    jacobian, small = arm.jacobian(BENT), 1e-6
    before = arm.pose(BENT)
    for i in range(6):
        after = arm.pose(BENT + small * np.eye(6)[i])
        turned = (rotation(after) * rotation(before).inv()).as_rotvec()
        assert jacobian[:3, i] == pytest.approx(
            (after.position - before.position) / small, abs=1e-5
        )
        assert jacobian[3:, i] == pytest.approx(turned / small, abs=1e-5)


def test_the_error_is_the_rotation_vector_of_scipy(arm: Kinematics) -> None:
    a, b = arm.pose(BENT), arm.pose(np.zeros(6))
    error = arm.error(a, b)
    assert error[:3] == pytest.approx(a.position - b.position)
    assert error[3:] == pytest.approx((rotation(a) * rotation(b).inv()).as_rotvec())


def test_the_inverse_reaches_a_pose_of_another_position(arm: Kinematics) -> None:
    target = arm.pose(BENT + 0.3)
    found = arm.solve(target, BENT)
    assert found is not None
    assert reached(arm.error(target, arm.pose(found)))


def test_the_inverse_stays_within_the_joint_limits(arm: Kinematics) -> None:
    edge = BENT.copy()
    edge[2] = 3.0
    beyond = edge.copy()
    beyond[2] = 3.2  # 0.15 rad beyond the limit of the elbow
    found = arm.solve(arm.pose(beyond), edge)
    assert found is None or (found <= arm.position_max).all()
    assert arm.position_max[2] == pytest.approx(np.radians(175))


def test_a_pose_out_of_reach_has_no_solution(arm: Kinematics) -> None:
    assert arm.solve(Pose(np.array([2.0, 0, 1.0]), np.array([1.0, 0, 0, 0])), BENT) is None


def test_a_straight_arm_is_singular(arm: Kinematics) -> None:
    assert condition(arm.jacobian(np.zeros(6))) > 1e6
    assert condition(arm.jacobian(np.array([0.1, 0.5, 1.2, 0.2, 1.2, 0.1]))) < 30


def test_a_body_can_be_named_instead_of_a_site() -> None:
    assert Kinematics(ARM, "link6").pose(np.zeros(6)).position[2] == pytest.approx(1.968)


def test_an_unknown_site_is_an_error() -> None:
    with pytest.raises(ConfigurationError, match="no site or body 'hand'"):
        Kinematics(ARM, "hand")

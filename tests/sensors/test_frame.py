from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from catenary.sensors import Frame

NUMBER = st.floats(-10.0, 10.0)
VECTOR = st.tuples(NUMBER, NUMBER, NUMBER)
QUATERNION = st.tuples(NUMBER, NUMBER, NUMBER, NUMBER).filter(lambda q: np.linalg.norm(q) > 0.1)


def test_a_force_at_a_lever_is_a_torque():
    # 10 N upwards at a sensor 0.2 m in front of the tool: -2 N·m about y, by the right-hand rule
    force, torque = Frame(translation=(0.2, 0.0, 0.0)).wrench([0, 0, 10], [0, 0, 0])
    assert force.tolist() == [0, 0, 10]
    assert torque == pytest.approx([0, -2, 0])


@given(QUATERNION)
def test_a_quaternion_gives_the_rotation_of_scipy(quaternion):
    expected = Rotation.from_quat(quaternion).as_matrix()
    np.testing.assert_allclose(Frame.from_quaternion(quaternion).rotation, expected, atol=1e-9)


@given(QUATERNION, VECTOR, VECTOR, VECTOR)
def test_the_inverse_undoes_a_frame(quaternion, translation, force, torque):
    frame = Frame.from_quaternion(quaternion, translation)
    back = frame.inverse().wrench(*frame.wrench(force, torque))
    np.testing.assert_allclose(back, (force, torque), atol=1e-9)


@given(QUATERNION, VECTOR, VECTOR, VECTOR, VECTOR, VECTOR)
def test_power_is_the_same_in_every_frame(quaternion, translation, force, torque, velocity, turn):
    """Force · velocity + torque · angular velocity does not depend on the frame."""
    frame = Frame.from_quaternion(quaternion, translation)
    moved_force, moved_torque = frame.wrench(force, torque)
    moved_turn = frame.vector(turn)
    moved_velocity = frame.vector(velocity) - np.cross(moved_turn, translation)
    before = np.dot(force, velocity) + np.dot(torque, turn)
    after = np.dot(moved_force, moved_velocity) + np.dot(moved_torque, moved_turn)
    assert after == pytest.approx(before, abs=1e-6)


@pytest.mark.parametrize(
    ("rotation", "translation"),
    [
        (2.0 * np.eye(3), (0, 0, 0)),
        (np.diag([1.0, 1.0, -1.0]), (0, 0, 0)),  # a mirror
        (np.eye(2), (0, 0, 0)),
        (np.eye(3), (0, 0)),
        (np.eye(3), (0, 0, float("nan"))),
    ],
)
def test_what_is_not_a_frame_is_refused(rotation, translation):
    with pytest.raises(ValueError, match="rotation"):
        Frame(rotation, translation)


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 0), (1, 0, 0), (1, 0, 0, float("inf"))])
def test_what_is_not_a_quaternion_is_refused(quaternion):
    with pytest.raises(ValueError, match="four finite"):
        Frame.from_quaternion(quaternion)

"""The right hand follows poses with Cartesian impedance, and bad poses are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")

import body
import hand
import mujoco
import tasks
from exchange import STATE, Exchange, Mode
from pose_source import TOPIC, PoseSource

from catenary.ros2 import messages
from tests.ros2.memory_backend import MemoryBackend

DT = 1e-3


@pytest.fixture
def pose() -> Any:
    """Pose of the hand in the standing pose."""
    return hand.Hand(body.MODEL, body.STAND).goal.copy()


def test_at_its_pose_the_hand_has_no_torque(pose: Any) -> None:
    follower = hand.Hand(body.MODEL, body.STAND)
    torque = follower.step(pose, body.STAND, np.zeros(33), DT)
    assert torque == pytest.approx(np.zeros(8), abs=1e-9)


def test_the_goal_moves_with_limited_speed_and_arrives(pose: Any) -> None:
    follower = hand.Hand(body.MODEL, body.STAND)
    wanted = pose + np.array([0.15, 0.0, 0.1, 0, 0, 0, 0])
    before = follower.goal[:3].copy()
    for _ in range(100):
        follower.step(wanted, body.STAND, np.zeros(33), DT)
    assert np.linalg.norm(follower.goal[:3] - before) == pytest.approx(hand.SPEED * 0.1)
    for _ in range(1000):
        follower.step(wanted, body.STAND, np.zeros(33), DT)
    assert follower.goal == pytest.approx(wanted)


def test_the_arm_of_a_fixed_body_reaches_the_pose(pose: Any) -> None:
    """The body hangs, gravity is compensated, and other joints are held."""
    model = body.load_model(step=1e-3)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    places, speeds = body.position_indices(model), body.velocity_indices(model)
    follower = hand.Hand(body.MODEL, body.STAND)
    wanted = pose + np.array([0.12, 0.02, 0.08, 0, 0, 0, 0])
    base = data.qpos[:7].copy()
    for _ in range(3000):
        data.qpos[:7], data.qvel[:6] = base, 0.0
        q, v = data.qpos[places], data.qvel[speeds]
        torque = body.STIFFNESS * (body.STAND - q) - body.DAMPING * v
        torque[hand.ROWS] = -0.05 * body.DAMPING[hand.ROWS] * v[hand.ROWS]
        torque[hand.ROWS] += follower.step(wanted, q, v, model.opt.timestep)
        data.qfrc_applied[speeds] = torque + data.qfrc_bias[speeds]
        mujoco.mj_step(model, data)
    arrived = data.body("pelvis").xmat.reshape(3, 3).T @ (
        data.site("right_hand").xpos - data.body("pelvis").xpos
    )
    # dry friction of the gears keeps the spring of the hand from its end
    assert np.linalg.norm(arrived - wanted[:3]) < 0.06


@pytest.mark.parametrize(
    ("frame", "change", "reason"),
    [
        ("world", [0] * 7, "frame 'world'"),
        ("pelvis", [np.nan, 0, 0, 0, 0, 0, 0], "not finite"),
        ("pelvis", [0, 0, 0, 1, 0, 0, 0], "unit quaternion"),
        ("pelvis", [2.0, 0, 0, 0, 0, 0, 0], "m from the shoulder"),
    ],
)
def test_a_bad_pose_is_refused(pose: Any, frame: str, change: Any, reason: str) -> None:
    assert hand.refusal("pelvis", pose) is None
    assert reason in str(hand.refusal(frame, pose + change))


class Running:
    """Task with a number of jobs, which deliver poses in between."""

    period = 2e-3

    def __init__(self, *actions: Any) -> None:
        self._actions = actions

    def __iter__(self) -> Any:
        for number, action in enumerate(self._actions):
            action()
            yield number

    def spend(self, seconds: float) -> None:
        assert seconds == 0.0


def test_the_task_follows_a_pose_until_a_preset_is_requested(pose: Any) -> None:
    x, node = Exchange(), MemoryBackend()
    state = np.zeros((), STATE)
    state["position"], state["mode"] = body.STAND, Mode.STAND
    x.state.write(state)
    source = PoseSource(node)
    seen = []

    def deliver() -> None:
        at, turn = messages.Point(*pose[:3]), messages.Quaternion(*pose[4:], pose[3])
        header = messages.Header(frame_id=hand.FRAME)
        node.deliver(TOPIC, messages.PoseStamped(header, messages.Pose(at, turn)))

    def look() -> None:
        seen.append(int(x.hand.read()["active"]))

    def preset() -> None:
        look()
        x.preset.write([1, 0])

    tasks.follow(Running(look, deliver, look, preset, look, look), 0.0, x, body.MODEL, source)
    assert seen == [0, 1, 1, 0, 0]

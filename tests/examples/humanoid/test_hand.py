"""Both hands follow poses with Cartesian impedance, and bad poses are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the body is simulated by MuJoCo: pip install 'catenary[sim]'")

import body
import hand
import mujoco
import tasks
from exchange import COMMAND, HAND, STATE, Exchange, Mode
from pose_source import TOPICS, PoseSource

from catenary.ros2 import messages
from tests.ros2.memory_backend import MemoryBackend

DT = 1e-3


SIDES = pytest.mark.parametrize("side", [0, 1], ids=body.SIDES)


def standing(side: int) -> Any:
    """Return the pose of a hand in the standing pose."""
    return hand.Hand(side, body.MODEL, body.STAND).goal.copy()


@SIDES
def test_at_its_pose_the_hand_has_no_torque(side: int) -> None:
    follower = hand.Hand(side, body.MODEL, body.STAND)
    torque = follower.step(standing(side), body.STAND, np.zeros(33), DT)
    assert torque == pytest.approx(np.zeros(8), abs=1e-9)


def test_the_goal_moves_with_limited_speed_and_arrives() -> None:
    follower = hand.Hand(1, body.MODEL, body.STAND)
    wanted = follower.goal + np.array([0.15, 0.0, 0.1, 0, 0, 0, 0])
    before = follower.goal[:3].copy()
    for _ in range(100):
        follower.step(wanted, body.STAND, np.zeros(33), DT)
    assert np.linalg.norm(follower.goal[:3] - before) == pytest.approx(hand.SPEED * 0.1)
    for _ in range(1000):
        follower.step(wanted, body.STAND, np.zeros(33), DT)
    assert follower.goal == pytest.approx(wanted)


@SIDES
def test_the_arm_of_a_fixed_body_reaches_the_pose(side: int) -> None:
    """The body hangs, gravity is compensated, and other joints are held."""
    model = body.load_model(step=1e-3)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    places, speeds = body.position_indices(model), body.velocity_indices(model)
    follower, rows = hand.Hand(side, body.MODEL, body.STAND), hand.ROWS[side]
    wanted = follower.goal + np.array([0.12, (-0.02, 0.02)[side], 0.08, 0, 0, 0, 0])
    base = data.qpos[:7].copy()
    for _ in range(3000):
        data.qpos[:7], data.qvel[:6] = base, 0.0
        q, v = data.qpos[places], data.qvel[speeds]
        torque = body.STIFFNESS * (body.STAND - q) - body.DAMPING * v
        torque[rows] = -0.05 * body.DAMPING[rows] * v[rows]
        torque[rows] += follower.step(wanted, q, v, model.opt.timestep)
        data.qfrc_applied[speeds] = torque + data.qfrc_bias[speeds]
        mujoco.mj_step(model, data)
    arrived = data.body("pelvis").xmat.reshape(3, 3).T @ (
        data.site(f"{body.SIDES[side]}_hand").xpos - data.body("pelvis").xpos
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
def test_a_bad_pose_is_refused(frame: str, change: Any, reason: str) -> None:
    for side in (0, 1):
        assert hand.refusal(side, "pelvis", standing(side)) is None
        assert reason in str(hand.refusal(side, frame, standing(side) + change))


def deliver(node: MemoryBackend, side: int, pose: Any, frame: str = hand.FRAME) -> None:
    """Deliver a pose (7,) to the topic of a hand."""
    at, turn = messages.Point(*pose[:3]), messages.Quaternion(*pose[4:], pose[3])
    header = messages.Header(frame_id=frame)
    node.deliver(TOPICS[side], messages.PoseStamped(header, messages.Pose(at, turn)))


def test_a_stream_of_bad_poses_is_reported_once(capsys: Any) -> None:
    node = MemoryBackend()
    source = PoseSource(node)
    for _ in range(3):
        deliver(node, 0, standing(0), frame="world")
        assert list(source.step()) == [None, None]
    assert capsys.readouterr().out.count("left_hand_pose: refused: the pose is in the frame") == 1
    deliver(node, 0, standing(0))
    source.step()
    deliver(node, 0, standing(0), frame="world")
    left, right = source.step()
    assert left == pytest.approx(standing(0))  # the last accepted pose
    assert right is None
    assert "refused" in capsys.readouterr().out


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


def loop_state(position: Any, mode: Mode = Mode.STAND) -> Any:
    """Return a `STATE` at rest."""
    state = np.zeros((), STATE)
    state["position"], state["mode"] = position, mode
    return state


def test_the_hands_follow_their_poses_until_a_preset_is_requested() -> None:
    x, node = Exchange(), MemoryBackend()
    x.state.write(loop_state(body.STAND))
    source = PoseSource(node)
    seen = []

    def look() -> None:
        seen.append(x.hand.read()["active"].tolist())

    def preset() -> None:
        look()
        x.preset.write([1, 0])

    jobs = Running(
        look,
        lambda: deliver(node, 1, standing(1)),
        lambda: (look(), deliver(node, 0, standing(0))),
        look,
        preset,
        look,
        look,
    )
    tasks.follow(jobs, 0.0, x, body.MODEL, source)
    assert seen == [[0, 0], [0, 1], [1, 1], [1, 1], [0, 0], [0, 0]]


def test_the_springs_return_when_the_task_of_the_hands_is_silent() -> None:
    """A killed task leaves its last torque, which does not fit the moving arm for long."""
    x, command, period = Exchange(), np.zeros((), COMMAND), 1e-3
    found = np.zeros((), HAND)
    found["active"], found["torque"] = (1, 0), 5.0
    x.hand.write(found)
    hands = tasks.Hands(x, period)
    for _ in range(round(tasks.SILENCE / period)):
        command["torque"] = 0.0
        hands.add(command)
    left, right = hand.ROWS
    assert (command["scale"][left] == 0.0).all()
    assert (command["scale"][right] == 1.0).all()
    assert (command["torque"][left] == 5.0).all()
    for _ in range(2):
        command["torque"] = 0.0
        hands.add(command)
    assert (command["scale"] == 1.0).all()
    assert (command["torque"] == 0.0).all()


def test_the_reference_follows_the_arm_of_an_active_hand() -> None:
    """Its springs return at the present position. The other arm has not moved."""
    x, moved = Exchange(), body.STAND.copy()
    moved[: tasks.UPPER_JOINTS] += 0.1
    found = np.zeros((), HAND)
    x.state.write(loop_state(body.STAND))
    references = []

    def look() -> None:
        references.append(x.arms.read()["position"].copy())

    def activate() -> None:
        found["active"] = 0, 1
        x.hand.write(found)
        x.state.write(loop_state(moved))

    def end() -> None:
        look()
        found["active"] = 0
        x.hand.write(found)

    tasks.arm_motion(Running(lambda: None, activate, end, look), 0.0, x)
    left, right = hand.ROWS
    for reference in references:
        assert reference[left] == pytest.approx(body.STAND[left], abs=1e-4)
        assert reference[right] == pytest.approx(moved[right], abs=1e-4)

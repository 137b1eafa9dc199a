"""examples/teleoperation: a glove commands a gripper without ROS 2, as glove.toml maps it."""

from __future__ import annotations

import math
import sys
from typing import Any

import pytest

pytest.importorskip("mujoco", reason="the fingers move in MuJoCo: pip install 'catenary[sim]'")

import catenary as cat
from catenary.ros2.config_file import read_config
from tests.examples.two_devices import FOLDER, load
from tests.share.names import own_name
from tests.share.processes import Program

DT = 4e-3  # [s]


def fingers() -> Any:
    glove = load("glove")
    return glove.Fingers(read_config(FOLDER / "glove.toml").commands, [0.0, 0.0])


def bent(thumb: float, index: float) -> Any:
    names = "index_flexion", "other", "thumb_flexion"
    return load("glove").JointState(names, (index, 9.0, thumb))


def test_the_fingers_follow_with_a_limited_speed_within_their_bounds() -> None:
    made = fingers()
    assert made.step(bent(0.5, 9.0), DT) == pytest.approx([DT, DT])
    for _ in range(200):
        made.step(bent(0.5, 9.0), DT)
    assert made.position == pytest.approx([0.6 * 0.5 - 0.1, 0.5])  # scale, offset, maximum


def test_the_fingers_hold_without_messages_for_the_time_out() -> None:
    made = fingers()
    made.step(bent(1.0, 1.0), DT)
    steps = [float(made.step(None, DT)[0]) for _ in range(60)]
    assert steps[48] == pytest.approx(50 * DT)  # 0.2 s
    assert steps[-1] == steps[50]


@pytest.mark.parametrize(
    ("thumb", "text"), [(math.nan, "'thumb_flexion' is nan"), (None, "no joi")]
)
def test_a_message_that_is_not_usable_moves_nothing(thumb: float | None, text: str) -> None:
    made = fingers()
    joints = load("glove").JointState(("index_flexion",), (1.0,))
    made.step(joints if thumb is None else bent(thumb, 1.0), DT)
    assert text in made.refused
    assert made.position == pytest.approx([0.0, 0.0])
    made.step(bent(0.5, 0.5), DT)
    assert made.refused == ""


def test_a_finger_at_the_block_presses_with_its_torque_limit() -> None:
    made, program = fingers(), load("gripper")
    with own_name("gripper") as name, program.gripper(program.virtual_gripper(), name) as running:
        loop, hand, share = running
        while not hand.enabled.all():
            next(loop)
        with cat.attach(name) as reader, reader.lease(axes=program.FINGERS, for_=10.0) as lease:
            for _ in range(400):
                lease.send(position=made.step(bent(1.0, 1.0), DT))
                for _ in range(4):
                    next(loop)
                    assert share.apply(hand) == []
        assert hand.actual.position == pytest.approx([0.294, 0.3], abs=2e-3)  # block, goal
        assert hand.actual.torque[0] == pytest.approx(0.3, abs=0.01)


def test_a_glove_without_a_gripper_is_reported() -> None:
    program = Program.of([sys.executable, str(FOLDER / "glove.py"), "--share", "test-none"])
    try:
        assert program.process.wait(60) == 1
    finally:
        program.close()


def test_both_programs_run_together() -> None:
    with own_name("gripper") as name:
        words = [sys.executable, str(FOLDER / "gripper.py"), "--share", name]
        gripper = Program.of(words)
        try:
            assert f"the share '{name}' has the fingers left, right" in gripper.line()
            words[1] = str(FOLDER / "glove.py")
            glove = Program.of([*words, "--seconds", "2"])
            try:
                assert glove.line().startswith("fingers at 0.50 0.46 rad")
            finally:
                glove.close()
            assert gripper.process.poll() is None
        finally:
            gripper.kill()
            gripper.close()

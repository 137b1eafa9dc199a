"""Joints of a glove, mapped to axes by name."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from catenary.errors import ConfigurationError
from catenary.ros2 import messages
from catenary.ros2.config import Commands, Config, MappedJoint, MappedJoints
from catenary.ros2.config_file import read_config
from catenary.ros2.forward import CommandError
from catenary.ros2.joint_map import JointMap
from tests.ros2.bridges import Rig, rig

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "teleoperation" / "glove.toml"
AXES = ("left", "right")
JOINTS = {
    "left": MappedJoint(joint="thumb", scale=-0.5, offset=0.1),
    "right": MappedJoint(joint="index", minimum=-0.2, maximum=0.3),
}


def state(**positions: float) -> Any:
    return SimpleNamespace(name=list(positions), position=list(positions.values()))


def test_scale_and_offset_are_applied_by_name_and_other_joints_are_ignored() -> None:
    found = JointMap(JOINTS, AXES)(state(ring=9.0, index=0.25, thumb=0.4))
    assert found == pytest.approx([-0.1, 0.25])


@pytest.mark.parametrize(("index", "expected"), [(5.0, 0.3), (-5.0, -0.2)])
def test_positions_are_clamped(index: float, expected: float) -> None:
    assert JointMap(JOINTS, AXES)(state(thumb=0.0, index=index))[1] == expected


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (state(thumb=0.0), "no joint 'index'; it has thumb"),
        (state(thumb=math.nan, index=0.0), "position of 'thumb' is nan"),
        (state(thumb=0.0, index=math.inf), "position of 'index' is inf"),
        (SimpleNamespace(name=["thumb", "index"], position=[0.0]), "1 positions for 2 names"),
        (SimpleNamespace(name=["thumb"] * 2, position=[0.0] * 2), "named twice"),
    ],
)
def test_unusable_messages_are_refused(message: Any, text: str) -> None:
    with pytest.raises(CommandError, match=text):
        JointMap(JOINTS, AXES)(message)


@pytest.mark.parametrize(
    ("joints", "text"),
    [
        ({"left": JOINTS["left"]}, "axis 'right' has no joint"),
        (JOINTS | {"up": JOINTS["left"]}, "no commanded axis 'up'"),
        (JOINTS | {"left": MappedJoint(joint="a", scale=0.0)}, "scale 0"),
        (JOINTS | {"left": MappedJoint(joint="a", offset=math.nan)}, "offset nan"),
        (JOINTS | {"left": MappedJoint(joint="a", minimum=1.0, maximum=0.0)}, "minimum 1"),
    ],
)
def test_unusable_configurations_are_refused(joints: Any, text: str) -> None:
    with pytest.raises(ConfigurationError, match=text):
        JointMap(joints, AXES)


def test_the_example_is_a_valid_configuration() -> None:
    config = read_config(EXAMPLE)
    assert config.commands.joint_states is not None
    assert config.commands.axes == AXES
    found = JointMap(config.commands.joint_states.axes, AXES)(
        state(thumb_flexion=0.5, index_flexion=9.0)
    )
    assert found == pytest.approx([0.2, 0.5])


def glove(names: tuple[str, ...]) -> Config:
    joints = {
        names[0]: MappedJoint(joint="thumb", scale=0.1),
        names[1]: MappedJoint(joint="index", scale=0.1, maximum=0.02),
    }
    return Config(commands=Commands(joint_states=MappedJoints(axes=joints)))


def send(running: Rig, thumb: float, index: float) -> None:
    given = messages.JointState(name=["index", "thumb"], position=[index, thumb])
    running.backend.deliver("glove/joint_states", given)
    running.step()


NAMES = ("1 Catenary virtual servo", "2 Catenary virtual servo")


def test_the_axes_follow_a_glove_until_its_time_out() -> None:
    with rig(glove(NAMES)) as running:
        assert running.until(lambda: bool(running.arm.enabled.all()))
        for _ in range(100):
            send(running, 0.1, 5.0)
        np.testing.assert_allclose(running.arm.target.position, [0.01, 0.02], atol=1e-6)
        assert running.until(lambda: not running.bridge._commands.active)
        assert running.last_report == "the stream of set-points has ended: no message in time"
        np.testing.assert_allclose(running.arm.target.position, [0.01, 0.02], atol=1e-6)


def test_a_message_with_nan_moves_nothing_and_is_reported() -> None:
    with rig(glove(NAMES)) as running:
        assert running.until(lambda: bool(running.arm.enabled.all()))
        before = running.arm.target.position.copy()
        send(running, math.nan, 0.0)
        assert "position of 'thumb' is nan" in running.last_report
        np.testing.assert_allclose(running.arm.target.position, before)


def test_a_glove_may_publish_with_the_qos_of_sensors() -> None:
    with rig(glove(NAMES)) as running:
        [qos] = [qos for topic, qos in qualities(running) if topic == "glove/joint_states"]
        assert qos.reliability == "best_effort"


def qualities(running: Rig) -> list[tuple[str, Any]]:
    return [(topic, entry[1]) for topic, entry in running.backend.subscriptions.items()]

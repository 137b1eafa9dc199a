"""Configuration of the bridge."""

from __future__ import annotations

from pathlib import Path

import pytest

from catenary.errors import ConfigurationError
from catenary.ros2.config import Config
from catenary.ros2.config_file import read_config


def written(folder: Path, text: str) -> Path:
    path = folder / "ros2.toml"
    path.write_text(text)
    return path


def refusal(folder: Path, text: str) -> str:
    path = written(folder, text)
    with pytest.raises(ConfigurationError) as caught:
        read_config(path)
    return str(caught.value).replace(str(path), "ros2.toml")


def test_an_empty_file_has_the_defaults(tmp_path: Path) -> None:
    assert read_config(written(tmp_path, "")) == Config()


def test_tables_and_lists_are_read(tmp_path: Path) -> None:
    config = read_config(
        written(
            tmp_path,
            """
            node = "arm"
            joints = { "2 Servo" = "shoulder" }
            [joint_states]
            rate = 200.0
            [[wrench]]
            share = "arm.wrist"
            force = ["force[0]", "force[1]", "force[2]"]
            [[process_data]]
            field = "pressure"
            topic = "pressure"
            """,
        )
    )
    assert config.node == "arm"
    assert config.joints == {"2 Servo": "shoulder"}
    assert config.joint_states.rate == 200.0
    assert config.wrench[0].force == ("force[0]", "force[1]", "force[2]")
    assert config.process_data[0].type == "float64"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("nodee = 'x'", 'ros2.toml:1: nodee: unknown key "nodee"\n  hint: did you mean "node"?'),
        (
            "[commands]\n[commands.forward]\ntimout = 1.0",
            'ros2.toml:3: commands.forward.timout: unknown key "timout"\n'
            '  hint: did you mean "timeout"?',
        ),
        (
            "\n[joint_states]\nrate = 0.0",
            "ros2.toml:3: joint_states.rate: expected `float` > 0.0",
        ),
        (
            "[[imu]]\nshare = 'a'\n[[imu]]\nshare = 'b'\nrate = 'fast'",
            "ros2.toml:5: imu[1].rate: expected `float`, got `str`",
        ),
        (
            "[[wrench]]\nshare = 'w'\nforce = ['x', 'y']",
            "ros2.toml:3: wrench[0].force: expected `array` of length >= 3",
        ),
        ("[[wrench]]\ntopic = 'w'", "wrench[0]: object missing required field `share`"),
        ("[joint_states]\ntopic = 'a b'", "joint_states.topic: 'a b' is not a valid name"),
        ("[commands]\nrate = 10", "ros2.toml:2: commands.rate: expected `float` >= 50.0"),
        ("namespace = '1x'", "ros2.toml:1: namespace: '1x' is not a valid name"),
        ("domain = 233", "ros2.toml:1: domain: expected `int` <= 232"),
        ("a = ?", "ros2.toml: not TOML: Invalid value (at line 1, column 5)"),
    ],
)
def test_a_mistake_is_located(tmp_path: Path, text: str, expected: str) -> None:
    assert expected in refusal(tmp_path, text)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"gone\.toml: No such file"):
        read_config(tmp_path / "gone.toml")


def test_a_profile_sets_defaults_that_the_file_overrides(tmp_path: Path) -> None:
    text = 'profile = "rdda"\n[joint_states]\nrate = 50.0\n[[process_data]]\nfield = "p"\ntopic="p"'
    config = read_config(written(tmp_path, text))
    assert (config.joint_states.topic, config.joint_states.rate) == ("joint_stats", 50.0)
    assert config.commands.point.on
    assert config.commands.point.topic == "joint_cmds"
    assert not config.commands.trajectory.on
    assert [each.topic for each in config.process_data] == ["p", "ctrl_stats"]


def test_a_model_is_relative_to_the_file(tmp_path: Path) -> None:
    text = '[commands.pose]\nmodel = "arm.xml"\nsite = "tool"'
    pose = read_config(written(tmp_path, text)).commands.pose
    assert pose is not None
    assert pose.model == str(tmp_path / "arm.xml")

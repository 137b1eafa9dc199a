"""examples/ros2/rdda.toml is a valid configuration with the topics of proxy.py."""

from __future__ import annotations

from pathlib import Path

from catenary.ros2.config_file import read_config

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "ros2"


def test_the_configuration_has_the_topics_of_the_proxy() -> None:
    config = read_config(EXAMPLE / "rdda.toml")
    proxy = (EXAMPLE / "proxy.py").read_text()
    [stiffness] = config.parameters
    topics = [config.joint_states.topic, config.commands.point.topic, stiffness.topic]
    assert all(f'"{topic}"' in proxy for topic in topics)
    assert f'namespace="/{config.namespace}"' in proxy
    assert config.commands.point.on
    assert len(stiffness.names) == 2

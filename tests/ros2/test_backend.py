"""Tests of the choice of a backend and of Qos."""

from __future__ import annotations

import pytest

from catenary.errors import ConfigurationError
from catenary.ros2 import backend
from catenary.ros2.backend import Qos, missing_hint, open_backend


def test_without_any_package_the_error_names_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "find_spec", lambda name: None)
    monkeypatch.setattr(backend.platform, "machine", lambda: "x86_64")
    with pytest.raises(ConfigurationError, match=r"pip install 'catenary\[ros2\]'"):
        open_backend("bridge")


def test_on_arm64_the_error_names_rclpy() -> None:
    assert missing_hint("aarch64") == (
        "cyclonedds has no wheel for aarch64; source a ROS 2 installation (rclpy)"
    )


def test_rclpy_is_refused_without_a_ros_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "find_spec", lambda name: None)
    with pytest.raises(ConfigurationError, match=r"source /opt/ros/DISTRO/setup\.bash"):
        open_backend("bridge", kind="rclpy")


def test_names_are_checked_first() -> None:
    with pytest.raises(ValueError, match="invalid node name 'my node'"):
        open_backend("my node")


@pytest.mark.parametrize("options", [{"depth": 0}, {"deadline": 0.0}, {"deadline": float("nan")}])
def test_qos_refuses_impossible_numbers(options: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        Qos(**options)  # type: ignore[arg-type]

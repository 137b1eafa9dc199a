"""The ROS 2 task of examples/cobot: joint states of each cycle, or a printed reason."""

from __future__ import annotations

import importlib.util
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from catenary.errors import ConfigurationError
from tests.ros2.memory_backend import MemoryBackend

pytest.importorskip("mujoco", reason="the arm is simulated by MuJoCo: pip install 'catenary[sim]'")
pytest.importorskip("ruckig", reason="motions are made by ruckig: pip install 'catenary[traj]'")

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "cobot"
LAYOUT = SimpleNamespace(utc_offset_ns=1_700_000_000_000_000_000)
CYCLE = np.zeros(
    1, [("scheduled_ns", "i8"), *((n, "f8", 6) for n in ("position", "velocity", "torque"))]
)[0]


@pytest.fixture
def cobot(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    spec = importlib.util.spec_from_file_location("cobot_example", FOLDER / "cobot.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setattr(sys, "path", list(sys.path))
    spec.loader.exec_module(module)
    return module


def test_a_cycle_becomes_a_joint_state(cobot: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    node = MemoryBackend()
    monkeypatch.setattr(cobot.backend, "open_backend", lambda name, namespace: node)
    row = CYCLE.copy()
    row["scheduled_ns"], row["position"] = 5_000_000_001, np.arange(6)
    with cobot.ros2_node() as opened:
        cobot.joint_states(opened, LAYOUT)(row)
    [message] = node.publishers["joint_states"].messages
    assert message.header.stamp.to_ns() == 1_700_000_005_000_000_001
    assert list(message.position) == [0, 1, 2, 3, 4, 5]
    assert len(message.name) == len(message.velocity) == len(message.effort) == 6
    assert node.closed


def test_without_ros_2_the_reason_is_printed(
    cobot: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def missing(name: str, namespace: str) -> None:
        raise ConfigurationError("cyclonedds is not importable", hint="pip install it")

    monkeypatch.setattr(cobot.backend, "open_backend", missing)
    with cobot.ros2_node() as opened:
        cobot.joint_states(opened, LAYOUT)(CYCLE)
    assert "no joint states are published: cyclonedds is not importable" in capsys.readouterr().out


def test_the_names_are_those_of_the_model(cobot: ModuleType) -> None:
    joints = ElementTree.parse(FOLDER / "arm.xml").getroot().iter("joint")
    assert [each.get("name") for each in joints if each.get("name")] == list(cobot.JOINT_NAMES)

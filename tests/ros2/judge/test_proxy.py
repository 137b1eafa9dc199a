"""examples/ros2/proxy.py, with rclpy, against a node of ours that plays the bridge."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.ros2.judge.process import RELIABLE, Graph, NodeProcess, eventually
from tests.ros2.judge.test_rclpy import own_domain

PROXY = Path(__file__).resolve().parents[3] / "examples" / "ros2" / "proxy.py"
CENTER = [0.2, 0.3]
STATE = {"name": ["left", "right"], "position": CENTER}
POINT, ARRAY = "trajectory_msgs/msg/JointTrajectoryPoint", "std_msgs/msg/Float64MultiArray"


@pytest.fixture
def graph(ros2: Path) -> Graph:
    environment = {
        "ROS_DOMAIN_ID": own_domain(),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }
    return Graph(ros2, "rclpy", environment)


@pytest.fixture
def bridge(graph: Graph) -> Iterator[NodeProcess]:
    with graph.own("bridge", "/rdda") as node:
        node.ask("advertise", topic="joint_stats", type="sensor_msgs/msg/JointState", qos=RELIABLE)
        yield node


@contextmanager
def proxy(graph: Graph, *words: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [str(graph.judge), str(PROXY), *words],
        env={**os.environ, **graph.environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def until_it_ends(process: subprocess.Popen[str], bridge: NodeProcess) -> str:
    """Publish joint states until the proxy ends. Return what it printed."""

    def ended() -> bool:
        bridge.ask("publish", topic="joint_stats", type="sensor_msgs/msg/JointState", fields=STATE)
        return process.poll() is not None

    eventually(ended)
    assert process.stdout is not None
    assert process.stderr is not None
    printed = process.stdout.read()
    assert process.returncode == 0, process.stderr.read()
    return printed


def test_home_calls_the_service(graph: Graph, bridge: NodeProcess) -> None:
    bridge.ask("serve", name="home", kind="trigger", success=True, message="both stops found")
    with proxy(graph, "home") as process:
        assert until_it_ends(process, bridge) == "both stops found\npositions [0.2, 0.3]\n"
    assert bridge.ask("requested") == [None]


def test_a_wave_moves_all_fingers_around_their_positions(graph: Graph, bridge: NodeProcess) -> None:
    bridge.ask("subscribe", topic="joint_cmds", type=POINT, qos=RELIABLE)
    with proxy(graph, "wave", "0.4", "1.0", "--duration", "2.0") as process:
        until_it_ends(process, bridge)
    points: list[Any] = bridge.ask("messages", topic="joint_cmds")
    offsets = [point["positions"][0] - CENTER[0] for point in points]
    assert len(points) > 20
    assert -1e-9 <= min(offsets) < 0.05
    assert 0.35 < max(offsets) <= 0.4 + 1e-9
    for point in points:
        assert point["positions"][1] - point["positions"][0] == pytest.approx(0.1)


def test_the_stiffness_arrives(graph: Graph, bridge: NodeProcess) -> None:
    bridge.ask("subscribe", topic="stiffness", type=ARRAY, qos=RELIABLE)
    with proxy(graph, "stiffness", "2.0", "3.5") as process:
        until_it_ends(process, bridge)
    assert [message["data"] for message in bridge.ask("messages", topic="stiffness")] == [
        [2.0, 3.5]
    ]

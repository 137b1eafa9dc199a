"""`catenary ros2` as a process, against rclpy of Jazzy and Kilted."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import catenary as cat
from catenary.virtual import Segment
from catenary.virtual.devices import Coupler, Servo
from tests.ros2.judge.process import RELIABLE, Graph, NodeProcess, eventually
from tests.ros2.judge.test_rclpy import own_domain
from tests.share.names import own_name

TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
STATES = "sensor_msgs/msg/JointState"


@dataclass
class Machine:
    """A loop in virtual time that a thread iterates, and that accepts leased commands."""

    name: str
    arm: cat.Drives
    ended: list[str] = field(default_factory=list)


@contextmanager
def machine() -> Iterator[Machine]:
    stop = threading.Event()
    with (
        own_name("ros2") as name,
        cat.MainDevice(Segment([Coupler(), Servo(), Servo()])) as main,
        cat.Share(name, jog=True) as share,
    ):
        main.scan()
        arm = cat.Drives(main.subs.drives, counts_per_turn=2**20, velocity_limit=2.0)
        found = Machine(name, arm)

        def run(loop: cat.Loop) -> None:
            for _ in loop:
                found.ended += [str(end.reason.name) for end in share.apply(arm)]
                if stop.is_set():
                    break
                time.sleep(0.001)  # the bridge, a real process, needs time

        with cat.Loop(arm, period=1e-3, sink=share) as loop:
            thread = threading.Thread(target=run, args=(loop,))
            thread.start()
            try:
                yield found
            finally:
                stop.set()
                thread.join()


@contextmanager
def bridge(name: str, environment: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "catenary.cli", "ros2", name, "--backend", "cyclone"]
    with subprocess.Popen(
        [*command, "--namespace", "/left"],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **environment},
    ) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline().startswith("/left/catenary by cyclone")
            yield process
        finally:
            process.kill()


@pytest.fixture
def graph(ros2: Path) -> Graph:
    pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")
    environment = {
        "ROS_DOMAIN_ID": own_domain(),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }
    return Graph(ros2, "cyclone", environment)


def command(peer: NodeProcess, arm: cat.Drives, offset: float, seconds: int) -> list[float]:
    """Publish a trajectory from rclpy. Return its end."""
    goal = [float(position) + offset for position in arm.actual.position]
    point = {"positions": goal, "time_from_start": {"sec": seconds, "nanosec": 0}}
    fields = {"joint_names": list(arm.names), "points": [point]}
    peer.ask("advertise", topic="/left/joint_trajectory", type=TRAJECTORY, qos=RELIABLE)
    eventually(lambda: peer.ask("matched", topic="/left/joint_trajectory"))
    start = arm.target.position.copy()

    def moves() -> bool:  # a match of the publisher only may lose the first message
        peer.ask("publish", topic="/left/joint_trajectory", type=TRAJECTORY, fields=fields)
        time.sleep(0.1)
        return bool((arm.target.position != start).any())

    eventually(moves)
    return goal


def test_rclpy_reads_the_joints_and_moves_them(graph: Graph) -> None:
    with graph.peer() as peer, machine() as found, bridge(found.name, graph.environment):
        peer.ask("subscribe", topic="/left/joint_states", type=STATES, qos=RELIABLE)
        received = eventually(lambda: peer.ask("messages", topic="/left/joint_states"))
        assert received[-1]["name"] == list(found.arm.names)
        eventually(lambda: bool(found.arm.enabled.all()))
        goal = command(peer, found.arm, 0.2, 1)
        eventually(lambda: abs(found.arm.actual.position - goal).max() < 0.01)
        end = eventually(lambda: peer.ask("messages", topic="/left/joint_states"))[-1]
        assert abs(end["position"][0]) > 0.0
        eventually(lambda: "RELEASED" in found.ended)


def test_the_axes_hold_when_the_bridge_is_killed(graph: Graph) -> None:
    with (
        graph.peer() as peer,
        machine() as found,
        bridge(found.name, graph.environment) as process,
    ):
        eventually(lambda: bool(found.arm.enabled.all()))
        start = float(found.arm.actual.position[0])
        command(peer, found.arm, 20.0, 30)
        eventually(lambda: found.arm.actual.position[0] > start + 0.05)
        process.kill()
        eventually(lambda: bool(found.ended))
        assert found.ended == ["DIED"]
        eventually(lambda: abs(found.arm.actual.velocity).max() < 1e-3)
        assert found.arm.actual.position[0] < start + 19.0


def test_a_flood_of_bad_commands_moves_nothing_and_does_not_stop_the_topics(graph: Graph) -> None:
    with graph.peer() as peer, machine() as found, bridge(found.name, graph.environment):
        eventually(lambda: bool(found.arm.enabled.all()))
        start = found.arm.target.position.copy()
        topic = "/left/joint_trajectory"
        peer.ask("subscribe", topic="/left/joint_states", type=STATES, qos=RELIABLE)
        peer.ask("advertise", topic=topic, type=TRAJECTORY, qos=RELIABLE)
        eventually(lambda: peer.ask("matched", topic=topic))
        fields = {"joint_names": ["none"], "points": [{"positions": [1.0]}]}
        for _ in range(20):
            peer.ask("flood", topic=topic, type=TRAJECTORY, fields=fields, count=100)
        before = len(peer.ask("messages", topic="/left/joint_states"))
        eventually(lambda: len(peer.ask("messages", topic="/left/joint_states")) > before)
        assert (found.arm.target.position == start).all()
        assert found.ended == []  # a refused command takes no lease

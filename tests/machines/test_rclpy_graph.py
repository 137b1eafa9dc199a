"""A node of rclpy on a third machine: it reads and moves the arms of two other machines."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

import catenary as cat
from catenary.share import Reader
from tests.machines.namespaces import Machine, connected_machines
from tests.machines.test_two_machines import robot
from tests.ros2.judge.process import FOLDER, RELIABLE, NodeProcess, ended, eventually
from tests.share.names import own_name

pytest.importorskip("cyclonedds", reason="needs cyclonedds (catenary[ros2])")

STATES = "sensor_msgs/msg/JointState"
TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
TURNS = {"left": 0.2, "right": -0.3}  # [rad]


@pytest.fixture
def machines(veth: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Machine]]:
    """Three machines; `veth` skips the test without a private network."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(1 + os.getpid() % 200))
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE", raising=False)
    with connected_machines(3) as found:
        yield found


@contextmanager
def rclpy_node(machine: Machine, python: Path) -> Iterator[NodeProcess]:
    command = machine.command(str(FOLDER / "peer.py"), "judge", "", python=str(python))
    yield from ended(NodeProcess(command, {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}))


def turn(peer: NodeProcess, side: str, arm: Reader) -> None:
    """Publish a trajectory from rclpy until the arm moves, and wait for its end."""
    start = arm.read()["position"]
    goal = [float(position) + TURNS[side] for position in start]
    point = {"positions": goal, "time_from_start": {"sec": 1, "nanosec": 0}}
    fields = {"joint_names": list(arm.layout.axes), "points": [point]}
    topic = f"/{side}/joint_trajectory"
    peer.ask("advertise", topic=topic, type=TRAJECTORY, qos=RELIABLE)

    def moves() -> bool:  # the first messages are lost until both ends match
        peer.ask("publish", topic=topic, type=TRAJECTORY, fields=fields)
        arm.wait(timeout=0.1)
        return bool(abs(arm.read()["position"] - start).min() > 0.01)

    eventually(moves)
    eventually(lambda: abs(arm.read()["position"] - goal).max() < 0.01)


def test_rclpy_reads_and_moves_the_arms_of_two_machines(
    machines: list[Machine], ros2: Path
) -> None:
    with ExitStack() as stack:
        names = {side: stack.enter_context(own_name(side)) for side in TURNS}
        for machine, (side, name) in zip(machines, names.items(), strict=False):
            stack.enter_context(robot(machine, "arm", name, side))
        peer = stack.enter_context(rclpy_node(machines[2], ros2))
        eventually(lambda: {"/left/catenary", "/right/catenary"} <= set(peer.ask("nodes")))
        arms = {side: stack.enter_context(cat.attach(name)) for side, name in names.items()}
        for side, arm in arms.items():
            topic = f"/{side}/joint_states"
            peer.ask("subscribe", topic=topic, type=STATES, qos=RELIABLE)
            received = eventually(lambda topic=topic: peer.ask("messages", topic=topic))
            assert received[0]["name"] == list(arm.layout.axes)
        turn(peer, "left", arms["left"])
        assert abs(arms["right"].read()["position"]).max() < 0.01
        turn(peer, "right", arms["right"])
        for side, angle in TURNS.items():
            state = peer.ask("messages", topic=f"/{side}/joint_states")[-1]
            assert state["position"] == pytest.approx([angle] * 6, abs=0.02)

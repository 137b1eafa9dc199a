"""`catenary ros2` under rclpy of Jazzy and Kilted, as a process: services, joints, parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import catenary as cat
from catenary.virtual.devices import Servo
from catenary.wire.cia402 import AxisState, Mode, state_of
from tests.remote.programs import Running
from tests.ros2.judge.machines import background_machine, bridge_under_rclpy
from tests.ros2.judge.process import RELIABLE, Graph, NodeProcess, eventually
from tests.ros2.judge.test_bridge_process import STATES, command
from tests.ros2.judge.test_rclpy import own_domain

DOUBLE = 3  # rcl_interfaces/msg/ParameterType.PARAMETER_DOUBLE
PATIENT = "[services]\ntimeout = 30.0\n"


@pytest.fixture
def graph(ros2: Path) -> Graph:
    environment = {
        "ROS_DOMAIN_ID": own_domain(),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }
    return Graph(ros2, "rclpy", environment)


@contextmanager
def bridged(graph: Graph, folder: Path, servo: Servo) -> Iterator[tuple[Running, NodeProcess]]:
    """Run an enabled machine, a bridge under rclpy and a client of rclpy."""
    file = folder / "ros2.toml"
    file.write_text(PATIENT)
    with (
        graph.peer() as peer,
        background_machine(servo) as running,
        bridge_under_rclpy(running.name, graph, "--config", str(file)),
    ):
        eventually(lambda: bool(running.arm.enabled.all()))
        yield running, peer


def request(peer: NodeProcess, service: str) -> None:
    """Call a service of the bridge, which must succeed."""
    answer = peer.ask("call", name=f"/left/{service}", type="std_srvs/srv/Trigger", fields={})
    assert answer["success"], answer["message"]


def ask_parameters(peer: NodeProcess, service: str, **fields: Any) -> Any:
    """Call one of the services of parameters of the bridge."""
    kind = "".join(word.capitalize() for word in service.split("_"))
    return peer.ask(
        "call", name=f"/left/catenary/{service}", type=f"rcl_interfaces/srv/{kind}", fields=fields
    )


def set_together(peer: NodeProcess, **values: float) -> Any:
    """Set parameters of the law in one request. Return its result."""
    made = [
        {"name": f"impedance.{name}", "value": {"type": DOUBLE, "double_value": value}}
        for name, value in values.items()
    ]
    return ask_parameters(peer, "set_parameters_atomically", parameters=made)["result"]


def value_of(peer: NodeProcess, name: str) -> Any:
    """Return the value of a parameter of the law; None before it is declared."""
    [value] = ask_parameters(peer, "get_parameters", names=[f"impedance.{name}"])["values"] or [{}]
    return value["double_value"] if value.get("type") == DOUBLE else None


def test_parameters_of_the_law(graph: Graph, tmp_path: Path) -> None:
    pytest.importorskip("numba")

    stiffness = cat.Parameter("stiffness", 0, 40, "N·m/rad")
    mass = cat.Parameter("mass", 0.0)  # without a largest value

    @cat.law(parameters=[stiffness, "damping", mass])
    def impedance(target, parameters):  # type: ignore[no-untyped-def]
        target.position[0] = 0.0 * parameters[0]

    with bridged(graph, tmp_path, Servo()) as (running, peer):
        run = running.loop.start(impedance, parameters=[1.0, 2.0, 1.0])
        eventually(lambda: value_of(peer, "damping") == 2.0)
        names = ["impedance.stiffness"]
        [found] = ask_parameters(peer, "describe_parameters", names=names)["descriptors"]
        assert found["description"] == "[N·m/rad]"
        [limits] = found["floating_point_range"]
        assert (limits["from_value"], limits["to_value"]) == (0.0, 40.0)

        assert set_together(peer, stiffness=3.0, damping=4.0) == {"successful": True, "reason": ""}
        assert run.parameters.tolist() == [3.0, 4.0, 1.0]
        assert set_together(peer, mass=1e300)["successful"]
        assert "out of range" in set_together(peer, mass=-1.0)["reason"]
        refused = set_together(peer, damping=5.0, stiffness=41.0)
        assert not refused["successful"]
        assert "out of range" in refused["reason"]
        refused = set_together(peer, stiffness=5.0, damping=math.inf)
        assert refused == {
            "successful": False,
            "reason": "parameter 'damping': inf is not a finite number",
        }
        assert run.parameters.tolist() == [3.0, 4.0, 1e300]

        run.parameters = [50.0, 6.0, 1.0]  # another program changes them, even beyond the range
        eventually(lambda: value_of(peer, "damping") == 6.0)
        assert value_of(peer, "stiffness") == 50.0


def test_without_control_msgs_the_bridge_names_the_missing_action(graph: Graph) -> None:
    with (
        background_machine(Servo()) as running,
        bridge_under_rclpy(running.name, graph) as process,
    ):
        assert process.stdout is not None
        assert process.stdout.readline() == (
            "note: the action FollowJointTrajectory needs control_msgs, which is not installed\n"
        )


def test_services_change_the_state_of_the_axes(graph: Graph, tmp_path: Path) -> None:
    servo = Servo()
    with (
        bridged(graph, tmp_path, servo) as (running, peer),
        cat.attach(running.name) as reader,
    ):

        def state() -> Any:
            return state_of(int(reader.read()["statusword"][0]))

        request(peer, "stop")
        eventually(lambda: not running.arm.enabled.any())
        request(peer, "enable")
        eventually(lambda: bool(running.arm.enabled.all()))
        servo.inject_fault(0x7500)
        eventually(lambda: state() is AxisState.FAULT)
        servo.inject_fault(0)  # removes the cause
        request(peer, "reset")
        eventually(lambda: state() is not AxisState.FAULT)


def test_home_changes_the_mode_of_the_axis(graph: Graph, tmp_path: Path) -> None:
    with (
        bridged(graph, tmp_path, Servo()) as (running, peer),
        cat.attach(running.name) as reader,
    ):
        request(peer, "home")
        eventually(lambda: Mode.HM in reader.rows(0)[0]["mode"])


def test_rclpy_reads_the_joints_and_moves_them(graph: Graph, tmp_path: Path) -> None:
    with bridged(graph, tmp_path, Servo()) as (running, peer):
        arm = running.arm
        peer.ask("subscribe", topic="/left/joint_states", type=STATES, qos=RELIABLE)
        first = eventually(lambda: peer.ask("messages", topic="/left/joint_states"))[0]
        assert first["name"] == list(arm.names)
        goal = command(peer, arm, 0.2, 1)
        eventually(lambda: abs(arm.actual.position - goal).max() < 0.01)

        def read() -> bool:
            last = peer.ask("messages", topic="/left/joint_states")[-1]
            return bool(abs(last["position"][0] - goal[0]) < 0.01)

        eventually(read)

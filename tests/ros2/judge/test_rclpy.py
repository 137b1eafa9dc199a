"""Both backends against rclpy of ROS 2 Jazzy and Kilted, in processes of their own."""

from __future__ import annotations

import itertools
import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from catenary.ros2.messages import JointState, message_type
from tests.ros2.examples_of_messages import EXAMPLES
from tests.ros2.judge.process import (
    BEST_EFFORT,
    RELIABLE,
    Graph,
    NodeProcess,
    connect,
    eventually,
)

STATE = next(message for message in EXAMPLES if isinstance(message, JointState))
FIELDS = json.loads(msgspec.json.encode(STATE))
NODE = "/left/bridge"
KIND = "sensor_msgs/msg/JointState"
DOMAINS = itertools.count(os.getpid() % 100)


def own_domain() -> str:
    return str(1 + next(DOMAINS) % 230)


@pytest.fixture(params=["cyclone", "rclpy"])
def graph(request: pytest.FixtureRequest, ros2: Path) -> Graph:
    if request.param == "cyclone":
        pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")
    environment = {
        "ROS_DOMAIN_ID": own_domain(),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
    }
    return Graph(ros2, request.param, environment)


@pytest.fixture
def pair(graph: Graph) -> Iterator[tuple[NodeProcess, NodeProcess]]:
    with graph.own() as own, graph.peer() as peer:
        yield own, peer


def publish_until_received(
    publisher: NodeProcess, subscriber: NodeProcess, topic: str, fields: Any, kind: str = KIND
) -> list[Any]:
    """Publish until a message arrives: best effort, and a reader's match, may lose the first."""

    def received() -> Any:
        publisher.ask("publish", topic=topic, type=kind, fields=fields)
        return subscriber.ask("messages", topic=topic)

    messages: list[Any] = eventually(received)
    return messages


def test_every_message_arrives_at_rclpy_and_comes_back(
    pair: tuple[NodeProcess, NodeProcess],
) -> None:
    own, peer = pair
    for message in EXAMPLES:
        kind = message_type(type(message)).name
        fields = json.loads(msgspec.json.encode(message))
        name = kind.rpartition("/")[2].lower()
        for publisher, subscriber, topic in (
            (own, peer, f"/to/{name}"),
            (peer, own, f"/of/{name}"),
        ):
            connect(publisher, subscriber, topic, kind)
            assert publish_until_received(publisher, subscriber, topic, fields, kind)[0] == fields


@pytest.mark.parametrize("qos", [RELIABLE, BEST_EFFORT], ids=["reliable", "best_effort"])
def test_both_reliabilities(pair: tuple[NodeProcess, NodeProcess], qos: Any) -> None:
    own, peer = pair
    connect(own, peer, "/a", KIND, qos)
    connect(peer, own, "/b", KIND, qos)
    assert publish_until_received(own, peer, "/a", FIELDS)[0] == FIELDS
    assert publish_until_received(peer, own, "/b", FIELDS)[0] == FIELDS


def test_a_late_subscription_receives_a_transient_local_message(
    pair: tuple[NodeProcess, NodeProcess],
) -> None:
    own, peer = pair
    qos = ("reliable", "transient_local", 1, None)
    for publisher, subscriber, topic in ((own, peer, "/a"), (peer, own, "/b")):
        publisher.ask("advertise", topic=topic, type=KIND, qos=qos)
        publisher.ask("publish", topic=topic, type=KIND, fields=FIELDS)
        subscriber.ask("subscribe", topic=topic, type=KIND, qos=qos)
        assert eventually(lambda s=subscriber, t=topic: s.ask("messages", topic=t)) == [FIELDS]


def test_the_node_and_its_topic_are_in_the_graph(graph: Graph) -> None:
    with graph.own("bridge", "/left") as own, graph.peer() as peer:
        own.ask("advertise", topic="joint_states", type=KIND, qos=RELIABLE)
        eventually(lambda: NODE in peer.ask("nodes"))
        # Kilted does not assign endpoints of Cyclone DDS to their nodes.
        unassigned = graph.kind == "cyclone" and "kilted" in str(graph.judge)
        name = "_CREATED_BY_BARE_DDS_APP_/_CREATED_BY_BARE_DDS_APP_" if unassigned else NODE
        expected = [[name, KIND, message_type(JointState).rihs]]
        eventually(lambda: peer.ask("publishers_of", topic="/left/joint_states") == expected)


def test_a_closed_node_leaves_the_graph(graph: Graph) -> None:
    with graph.peer() as peer:
        with graph.own("bridge"):
            eventually(lambda: "/bridge" in peer.ask("nodes"))
        eventually(lambda: "/bridge" not in peer.ask("nodes"))


@pytest.mark.parametrize(
    ("offered", "requested", "policy"),
    [
        (BEST_EFFORT, RELIABLE, "reliability"),
        (RELIABLE, ("reliable", "transient_local", 1, None), "durability"),
        (RELIABLE, ("reliable", "volatile", 1, 0.1), "deadline"),
    ],
)
def test_a_qos_mismatch_is_reported(
    pair: tuple[NodeProcess, NodeProcess], offered: Any, requested: Any, policy: str
) -> None:
    own, peer = pair
    own.ask("advertise", topic="/a", type=KIND, qos=offered)
    peer.ask("subscribe", topic="/a", type=KIND, qos=requested)
    peer.ask("advertise", topic="/b", type=KIND, qos=offered)
    own.ask("subscribe", topic="/b", type=KIND, qos=requested)
    expected = {
        f"/a: a subscription requests more: {policy}",
        f"/b: a publisher offers less: {policy}",
    }
    eventually(lambda: set(own.ask("incompatible")) == expected)
    eventually(lambda: policy in peer.ask("incompatible"))
    assert own.ask("matched", topic="/a") == 0


def test_a_restarted_judge_receives_again(graph: Graph) -> None:
    with graph.own() as own:
        own.ask("advertise", topic="/a", type=KIND, qos=RELIABLE)
        own.ask("subscribe", topic="/b", type=KIND, qos=RELIABLE)
        for round_number in (1, 2):
            with graph.peer() as peer:
                peer.ask("subscribe", topic="/a", type=KIND, qos=RELIABLE)
                peer.ask("advertise", topic="/b", type=KIND, qos=RELIABLE)
                eventually(lambda: own.ask("matched", topic="/a"))
                eventually(lambda p=peer: p.ask("matched", topic="/b"))
                publish_until_received(own, peer, "/a", FIELDS)
                peer.ask("publish", topic="/b", type=KIND, fields=FIELDS)
                eventually(lambda n=round_number: len(own.ask("messages", topic="/b")) == n)
                if round_number == 1:
                    peer.kill()


def test_a_restarted_node_is_received_again(graph: Graph) -> None:
    with graph.peer() as peer:
        peer.ask("subscribe", topic="/a", type=KIND, qos=RELIABLE)
        for round_number in (1, 2):
            with graph.own() as own:
                own.ask("advertise", topic="/a", type=KIND, qos=RELIABLE)
                eventually(lambda o=own: o.ask("matched", topic="/a"))
                own.ask("publish", topic="/a", type=KIND, fields=FIELDS)
                eventually(lambda n=round_number: len(peer.ask("messages", topic="/a")) == n)
                if round_number == 1:
                    own.kill()


def test_another_domain_is_another_graph(graph: Graph) -> None:
    with graph.own() as own, graph.peer() as peer, graph.peer(ROS_DOMAIN_ID=own_domain()) as far:
        far.ask("subscribe", topic="/a", type=KIND, qos=RELIABLE)
        connect(own, peer, "/a", KIND)
        publish_until_received(own, peer, "/a", FIELDS)
        assert far.ask("messages", topic="/a") == []
        assert own.ask("matched", topic="/a") == 1


def test_relative_and_private_names(graph: Graph) -> None:
    with graph.own("bridge", "/left") as own, graph.peer() as peer:
        for topic, full in (("state", "/left/state"), ("~/state", "/left/bridge/state")):
            own.ask("advertise", topic=topic, type=KIND, qos=RELIABLE)
            peer.ask("subscribe", topic=full, type=KIND, qos=RELIABLE)
            eventually(lambda t=topic: own.ask("matched", topic=t))


def test_services(graph: Graph) -> None:
    if graph.kind == "cyclone":
        pytest.skip("the backend cyclone has no services")
    with graph.own("bridge") as own, graph.peer() as peer:
        own.ask("serve", name="~/enable", kind="set_bool", success=True, message="enabled")
        own.ask("serve", name="~/home", kind="trigger", success=False, message="not enabled")
        answer = peer.ask(
            "call", name="/bridge/enable", type="std_srvs/srv/SetBool", fields={"data": True}
        )
        assert answer == {"success": True, "message": "enabled"}
        answer = peer.ask("call", name="/bridge/home", type="std_srvs/srv/Trigger", fields={})
        assert answer == {"success": False, "message": "not enabled"}
        assert own.ask("requested") == [True, None]


def test_multicast_discovery_over_a_network_interface(graph: Graph, veth: tuple[str, str]) -> None:
    first, _ = veth
    subprocess.run(["ip", "address", "add", "10.77.0.1/24", "dev", first], check=True)
    reach = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    with graph.own(**reach) as own, graph.peer(**reach) as peer:
        connect(own, peer, "/a", KIND)
        connect(peer, own, "/b", KIND)
        assert publish_until_received(own, peer, "/a", FIELDS)[0] == FIELDS
        assert publish_until_received(peer, own, "/b", FIELDS)[0] == FIELDS


def test_a_flood_of_messages_does_not_stop_the_node(
    pair: tuple[NodeProcess, NodeProcess],
) -> None:
    own, peer = pair
    connect(peer, own, "/b", KIND, BEST_EFFORT)
    peer.ask("flood", topic="/b", type=KIND, fields=FIELDS, count=3000)
    assert own.ask("incompatible") == []
    assert eventually(lambda: own.ask("messages", topic="/b"))[-1] == FIELDS


def test_a_stopped_subscription_does_not_stop_the_publisher(
    pair: tuple[NodeProcess, NodeProcess],
) -> None:
    own, peer = pair
    connect(own, peer, "/a", KIND)
    last = {**FIELDS, "name": ["last"]}
    os.kill(peer.process.pid, signal.SIGSTOP)
    try:
        own.ask("flood", topic="/a", type=KIND, fields=FIELDS, count=5000)
        own.ask("publish", topic="/a", type=KIND, fields=last)
    finally:
        os.kill(peer.process.pid, signal.SIGCONT)
    eventually(lambda: last in peer.ask("messages", topic="/a"))

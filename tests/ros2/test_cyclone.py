"""Two nodes of the backend on Cyclone DDS in one process, on the loopback interface."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from catenary.errors import CatenaryError, ConfigurationError
from catenary.realtime import private_network
from catenary.ros2.backend import COMMAND, GLOVE, SENSOR, STATE, NotAvailable, Qos, open_backend
from catenary.ros2.messages import Float64MultiArray, JointState, String

cyclone = pytest.importorskip("catenary.ros2.cyclone", reason="cyclonedds is not installed")
dds = pytest.importorskip("cyclonedds.core")

PATIENCE = 20.0  # [s]
DOMAINS = itertools.count(os.getpid())
NOT_UTF_8 = bytes.fromhex("00010000 02000000 ff00")
MESSAGE = JointState(name=("a", "b"), position=(1.0, 2.0))


@pytest.fixture(autouse=True)
def _loopback_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + next(DOMAINS) % 100))


@pytest.fixture
def nodes() -> Iterator[tuple[Any, Any]]:
    left = open_backend("left", kind="cyclone")
    right = open_backend("right", kind="cyclone")
    yield left, right
    left.close()
    right.close()


def until(condition: Callable[[], Any]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_spin_once_runs_the_callbacks_in_order(nodes: tuple[Any, Any]) -> None:
    left, right = nodes
    received: list[String] = []
    publisher = left.publisher("text", String)
    right.subscription("text", String, STATE, received.append)
    until(lambda: publisher.matched == 1)
    sent = [String(str(number)) for number in range(5)]
    for message in sent:
        publisher.publish(message)
    right.spin_once(PATIENCE)
    assert received == sent


def test_only_the_newest_messages_are_kept(nodes: tuple[Any, Any]) -> None:
    left, right = nodes
    received: list[Float64MultiArray] = []
    publisher = left.publisher("command", Float64MultiArray, COMMAND)
    right.subscription("command", Float64MultiArray, COMMAND, received.append)
    until(lambda: publisher.matched == 1)
    for number in range(1000):
        publisher.publish(Float64MultiArray(data=(float(number),)))
    right.spin_once(PATIENCE)
    assert [message.data for message in received] == [(999.0,)]


@pytest.mark.parametrize("qos", [SENSOR, STATE], ids=["sensor", "state"])
def test_a_glove_is_received_with_both_usual_qualities(nodes: tuple[Any, Any], qos: Qos) -> None:
    left, right = nodes
    received: list[JointState] = []
    publisher = left.publisher("glove", JointState, qos)
    right.subscription("glove", JointState, GLOVE, received.append)
    until(lambda: publisher.matched == 1)
    publisher.publish(MESSAGE)
    right.spin_once(PATIENCE)
    assert [list(each.name) for each in received] == [["a", "b"]]


def test_a_message_that_cannot_be_decoded_is_ignored_and_reported(
    nodes: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    left, right = nodes
    received: list[String] = []
    publisher = left.publisher("text", String)
    right.subscription("text", String, STATE, received.append)
    until(lambda: publisher.matched == 1)
    with monkeypatch.context() as patch:
        patch.setattr(cyclone.cdr, "encode", lambda message: NOT_UTF_8)
        publisher.publish(String("a"))
    publisher.publish(String("b"))
    right.spin_once(PATIENCE)
    assert received == [String("b")]
    (report,) = right.incompatible
    assert report.startswith("/text: ignored a message: ")


def test_bad_messages_do_not_add_up(
    nodes: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    left, right = nodes
    publisher = left.publisher("text", String)
    right.subscription("text", String, STATE, print)
    until(lambda: publisher.matched == 1)
    reports = []
    for bad in (NOT_UTF_8, bytes.fromhex("00010000 03000000 41ff0000")):
        monkeypatch.setattr(cyclone.cdr, "encode", lambda message, bad=bad: bad)
        publisher.publish(String("a"))
        right.spin_once(PATIENCE)
        reports.append(right.incompatible)
    assert reports[0] == reports[1]
    assert len(reports[1]) == 1


def test_a_message_that_cyclone_refuses_raises(
    nodes: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    publisher = nodes[0].publisher("text", String)
    monkeypatch.setattr(cyclone.cdr, "encode", lambda message: bytes.fromhex("00010000 ff000000"))
    with pytest.raises(CatenaryError, match="cannot publish /text"):
        publisher.publish(String("a"))


def test_a_blocked_publisher_drops_messages_and_reports_it(
    nodes: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    publisher = nodes[0].publisher("text", String)
    timeout = dds.DDSException.DDS_RETCODE_TIMEOUT
    monkeypatch.setattr(cyclone, "ddspy_write", lambda reference, data: timeout)
    publisher.publish(String("a"))
    assert nodes[0].incompatible == ["/text: dropped messages because a subscription is slow"]


def test_a_mismatch_is_reported_on_both_sides_once(nodes: tuple[Any, Any]) -> None:
    left, right = nodes
    publisher = left.publisher("joint_states", JointState, SENSOR)
    right.subscription("joint_states", JointState, STATE, print)
    reports = ["/joint_states: a subscription requests more: reliability"]
    until(lambda: left.incompatible == reports)
    until(lambda: right.incompatible == ["/joint_states: a publisher offers less: reliability"])
    assert publisher.matched == 0
    assert left.incompatible == reports


def test_a_late_subscription_receives_the_last_transient_local_message(
    nodes: tuple[Any, Any],
) -> None:
    left, right = nodes
    received: list[JointState] = []
    qos = Qos("reliable", "transient_local", 1)
    left.publisher("state", JointState, qos).publish(MESSAGE)
    right.subscription("state", JointState, qos, received.append)
    right.spin_once(PATIENCE)
    assert received == [MESSAGE]


def test_the_first_node_can_close_before_the_second(nodes: tuple[Any, Any]) -> None:
    left, right = nodes
    left.close()
    with_publisher = right.publisher("state", JointState)
    third = open_backend("third", kind="cyclone")
    received: list[JointState] = []
    third.subscription("state", JointState, STATE, received.append)
    until(lambda: with_publisher.matched == 1)
    with_publisher.publish(MESSAGE)
    third.spin_once(PATIENCE)
    third.close()
    assert received == [MESSAGE]


def test_a_closed_domain_opens_again_with_its_configuration(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    open_backend("first", kind="cyclone").close()
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><Domain><Unknown/></Domain></CycloneDDS>")
    with pytest.raises(ConfigurationError, match="cannot join ROS domain"):
        open_backend("second", kind="cyclone")


def test_close_twice(nodes: tuple[Any, Any]) -> None:
    nodes[0].close()
    nodes[0].close()


def test_spin_once_without_a_subscription_returns(nodes: tuple[Any, Any]) -> None:
    nodes[0].spin_once(0.0)


def test_services_are_not_available(nodes: tuple[Any, Any]) -> None:
    with pytest.raises(NotAvailable, match="run with rclpy"):
        nodes[0].service("~/enable", "set_bool", lambda request: (True, ""))


def test_parameters_and_actions_are_not_available(nodes: tuple[Any, Any]) -> None:
    with pytest.raises(NotAvailable, match="run with rclpy"):
        nodes[0].parameters({}, lambda values: "")
    with pytest.raises(NotAvailable, match="run with rclpy"):
        nodes[0].follow_joint_trajectory("~/follow", None)


def test_without_a_network_interface_the_error_says_so() -> None:
    if isinstance(state := private_network.state(), private_network.Refused):
        pytest.skip(f"no private network: {state.reason}")
    program = "from catenary.ros2.backend import open_backend; open_backend('a', kind='cyclone')"
    done = subprocess.run(
        ["unshare", "--net", sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "cannot join ROS domain" in done.stderr
    assert "check that a network interface is up" in done.stderr

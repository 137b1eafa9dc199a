"""The Foxglove server, read by a WebSocket client of the protocol foxglove.sdk.v1."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import catenary as cat
from catenary.errors import CatenaryError, ShareError
from catenary.monitor.foxglove import FoxgloveServer
from catenary.plan.sink import Incident
from tests.record.beside import SharedLoop, shared_loop, until
from tests.share.names import own_name

pytest.importorskip("foxglove")
websockets = pytest.importorskip("websockets.sync.client")
decoders = pytest.importorskip("mcap_ros2._dynamic")

MESSAGE_HEAD = struct.Struct("<BIQ")  # opcode 1, subscription, time [ns]


@pytest.fixture
def shared() -> Iterator[SharedLoop]:
    with own_name("fox-glove") as name, shared_loop(name) as shared:
        shared.run(20)
        yield shared


class Client:
    """Client that subscribes to topics and decodes their messages."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._kinds: dict[int, Any] = {}
        self.channels: dict[str, Any] = {}

    def find(self, count: int) -> None:
        """Receive advertisements until `count` topics are known."""
        while len(self.channels) < count:
            received = self._socket.recv(timeout=30)
            if isinstance(received, str) and json.loads(received)["op"] == "advertise":
                found = json.loads(received)["channels"]
                self.channels |= {each["topic"].rpartition("/")[2]: each for each in found}

    def subscribe(self, *topics: str) -> None:
        subscriptions = []
        for name in topics:
            channel = self.channels[name]
            decode = decoders.generate_dynamic(channel["schemaName"], channel["schema"])
            self._kinds[channel["id"]] = decode[channel["schemaName"]]
            subscriptions.append({"id": channel["id"], "channelId": channel["id"]})
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))

    def message(self) -> tuple[str, int, Any]:
        """Return the topic, the time [ns] and the content of the next message."""
        while not isinstance(received := self._socket.recv(timeout=30), bytes) or received[0] != 1:
            pass
        _, number, time_ns = MESSAGE_HEAD.unpack_from(received)
        topic = next(name for name, each in self.channels.items() if each["id"] == number)
        return topic, time_ns, self._kinds[number](received[MESSAGE_HEAD.size :])


@contextmanager
def connected(server: FoxgloveServer, topics: int = 6) -> Iterator[Client]:
    server.take()
    url = f"ws://127.0.0.1:{server.port}"
    with websockets.connect(url, subprotocols=["foxglove.sdk.v1"]) as socket:
        assert socket.subprotocol == "foxglove.sdk.v1"
        client = Client(socket)
        client.find(topics)
        yield client


def is_subscribed(server: FoxgloveServer, name: str) -> bool:
    """Return True if the server has handled a subscription to this topic."""
    assert server._topics is not None
    channels = [out for _, out in server._topics._channels]
    own = (server._topics._log, server._topics._events, server._topics._diagnostics)
    return any(each.topic().endswith(name) and each.has_sinks() for each in (*channels, *own))


def test_every_cycle_arrives_with_its_values(shared: SharedLoop) -> None:
    with FoxgloveServer(shared.share.name, port=0) as server, connected(server) as client:
        client.subscribe("joint_states")
        assert until(lambda: is_subscribed(server, "joint_states"))
        shared.run(100)
        with cat.attach(shared.share.name) as reader:
            rows = reader.rows(reader.number - 100)[0]
        server.take()
        received = [client.message() for _ in range(100)]
    times = [time_ns for _, time_ns, _ in received]
    assert (np.diff(times) == 1_000_000).all()
    assert received[0][2].name == list(shared.share.layout.axes)
    positions = np.array([state.position for _, _, state in received])
    assert np.isin(rows["position"][0], positions).all()
    assert np.isin(positions[-1], rows["position"]).all()


def test_events_and_diagnostics_arrive(shared: SharedLoop) -> None:
    shared.share.report(Incident("DeviceLost", "device 2 is lost", 1.5))
    with FoxgloveServer(shared.share.name, port=0) as server, connected(server) as client:
        client.subscribe("log", "events", "diagnostics")
        for name in ("log", "events", "diagnostics"):
            assert until(lambda name=name: is_subscribed(server, name))
        server._topics._next_diagnostics = 0.0
        shared.run(10)
        server.take()
        received = {topic: content for topic, _, content in (client.message() for _ in range(3))}
    assert (received["log"].level, received["log"].msg) == (30, "device 2 is lost")
    assert json.loads(received["events"].data)["kind"] == "DeviceLost"
    bus, *axes = received["diagnostics"].status
    assert re.fullmatch(r"0 of 1\d cycles lost, 0 skipped", bus.message)
    assert [axis.message for axis in axes] == ["operation enabled"] * 3
    assert axes[0].values[0].value == "CSP"


def test_a_new_loop_replaces_the_topics(shared: SharedLoop) -> None:
    name = shared.share.name
    with FoxgloveServer(name, port=0) as server:
        server.take()
        before = server._topics
        shared.loop.close()
        shared.share.__exit__(None, None, None)
        with shared_loop(name, axes=2) as again:
            again.run(10)
            for _ in range(3):
                server.take()
            assert server._topics is not before
            with connected(server) as client:
                client.subscribe("joint_states")
                assert until(lambda: is_subscribed(server, "joint_states"))
                again.run(10)
                server.take()
                assert len(client.message()[2].position) == 2


def test_a_used_port_and_a_missing_share_are_errors(shared: SharedLoop) -> None:
    with FoxgloveServer(shared.share.name, port=0) as server:
        with pytest.raises(CatenaryError, match="cannot listen on") as caught:
            FoxgloveServer(shared.share.name, port=server.port)
        assert caught.value.hint == "choose another --port"
    with pytest.raises(ShareError):
        FoxgloveServer("not-there", port=0)

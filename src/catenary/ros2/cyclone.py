"""Backend without a ROS installation: a node on Cyclone DDS (package `cyclonedds`).

Messages are encoded and decoded by `catenary.ros2.cdr`; Cyclone DDS transports the bytes.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Literal

from cyclonedds._clayer import ddspy_take, ddspy_write
from cyclonedds.core import (
    DDSException,
    InstanceState,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy
from cyclonedds.qos import Qos as DdsQos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from msgspec import Struct

from catenary.errors import CatenaryError, DecodeError
from catenary.ros2 import cdr, cyclone_domain, discovery, names
from catenary.ros2.idl import idl_type
from catenary.ros2.interface import (
    STATE,
    ActionServer,
    Executor,
    Message,
    NotAvailable,
    Parameter,
    ParametersCallback,
    Qos,
    ServiceCallback,
    ServiceKind,
)

ANY = SampleState.Any | ViewState.Any | InstanceState.Any
TAKEN_AT_ONCE = 64  # messages of one subscription that one call of `spin_once` handles
# dds_qos_policy_id_t
POLICIES = {
    2: "durability",
    4: "deadline",
    11: "reliability",
    23: "data representation",
}
DISCOVERY_QOS = Qos("reliable", "transient_local", 1)


def dds_qos(qos: Qos, user_data: bytes) -> DdsQos:
    """Return the policies of an endpoint.

    Args:
        qos: quality of service.
        user_data: type hash.
    """
    policies = [
        Policy.Reliability.Reliable(0)
        if qos.reliability == "reliable"
        else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal
        if qos.durability == "transient_local"
        else Policy.Durability.Volatile,
        Policy.History.KeepLast(qos.depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(user_data),
    ]
    if qos.deadline is not None:
        policies.append(Policy.Deadline(duration(seconds=qos.deadline)))
    return DdsQos(*policies)


class CyclonePublisher:
    """Publisher of one topic."""

    def __init__(self, topic: str, writer: DataWriter[Any]) -> None:
        self.topic = topic
        self.writer = writer
        self.dropped = 0
        self._reference = writer._ref

    @property
    def matched(self) -> int:
        """Number of subscriptions that receive the messages."""
        return cyclone_domain.matched_subscriptions(self.writer)

    def publish(self, message: Struct) -> None:
        """Send a message. It is dropped and counted if a slow subscription blocks the writer.

        Raises:
            CatenaryError: Cyclone DDS refused the message.
        """
        data = cdr.encode(message)
        # Cyclone DDS takes multiples of four bytes.
        result = ddspy_write(self._reference, data + bytes(-len(data) % 4))
        if result == DDSException.DDS_RETCODE_TIMEOUT:
            self.dropped += 1
        elif result < 0:
            raise CatenaryError(f"cannot publish {self.topic}: {DDSException(result)}")


class CycloneSubscription:
    """Subscription of one topic."""

    def __init__(
        self,
        topic: str,
        reader: DataReader[Any],
        message: type[Struct],
        callback: Callable[[Any], None],
    ) -> None:
        self.topic = topic
        self.reader = reader
        self.condition = ReadCondition(
            reader, SampleState.NotRead | ViewState.Any | InstanceState.Any
        )
        self._message = message
        self._callback = callback
        self.undecodable = ""  # report of the first message that could not be decoded

    def deliver(self) -> None:
        """Call the callback for the received messages, oldest first."""
        samples = ddspy_take(self.reader._ref, ANY, TAKEN_AT_ONCE)
        if isinstance(samples, int):
            raise CatenaryError(f"cannot read {self.topic}: {DDSException(samples)}")
        for data, info in samples:
            if info.valid_data:
                self._decode(data)

    def _decode(self, data: bytes) -> None:
        try:
            message = cdr.decode(data, self._message)
        except DecodeError as error:
            # Only the first one: the reports of a node must not grow with the bad messages.
            if not self.undecodable:
                self.undecodable = f"{self.topic}: ignored a message: {error.message}"
        else:
            self._callback(message)


class CycloneBackend:
    """Node on Cyclone DDS. It owns the DDS participant and its endpoints."""

    name: Literal["cyclone", "rclpy"] = "cyclone"

    def __init__(self, node: str, namespace: str, domain: int) -> None:
        """Join a domain.

        Args:
            node: name of the node.
            namespace: namespace of the node.
            domain: number of the domain.
        """
        self._node = node
        self._namespace = names.full_namespace(namespace)
        config = cyclone_domain.configuration(os.environ)
        self._participant = cyclone_domain.open_participant(domain, config)
        self._publishers: list[CyclonePublisher] = []
        self._subscriptions: list[CycloneSubscription] = []
        self._mismatches: dict[str, None] = {}  # a set in the order of insertion
        self._waitset = WaitSet(self._participant)
        self._closed = False
        writer = DataWriter(
            self._participant,
            Topic(self._participant, discovery.TOPIC, idl_type(discovery.ParticipantEntitiesInfo)),
            dds_qos(DISCOVERY_QOS, b""),
        )
        self._discovery = CyclonePublisher(discovery.TOPIC, writer)
        self._announce()

    @property
    def incompatible(self) -> list[str]:
        """QoS mismatches, blocked publishers and undecodable messages seen until now."""
        self._mismatches.update(dict.fromkeys(self._new_mismatches()))
        return list(self._mismatches)

    def publisher(self, topic: str, message: type[Struct], qos: Qos = STATE) -> CyclonePublisher:
        """Create a publisher.

        Args:
            topic: name; relative names are in the namespace of the node.
            message: class of `catenary.ros2.messages`.
            qos: offered quality of service.
        """
        name = names.resolve(topic, self._node, self._namespace)
        user_data = discovery.endpoint_user_data(message)
        writer = DataWriter(self._participant, self._topic(name, message), dds_qos(qos, user_data))
        publisher = CyclonePublisher(name, writer)
        self._publishers.append(publisher)
        self._announce()
        return publisher

    def subscription(
        self,
        topic: str,
        message: type[Message],
        qos: Qos,
        callback: Callable[[Message], None],
    ) -> None:
        """Create a subscription.

        Args:
            topic: name; relative names are in the namespace of the node.
            message: class of `catenary.ros2.messages`.
            qos: requested quality of service.
            callback: receives each message, called by `spin_once`.
        """
        name = names.resolve(topic, self._node, self._namespace)
        user_data = discovery.endpoint_user_data(message)
        reader = DataReader(self._participant, self._topic(name, message), dds_qos(qos, user_data))
        subscription = CycloneSubscription(name, reader, message, callback)
        self._subscriptions.append(subscription)
        self._waitset.attach(subscription.condition)
        self._announce()

    def service(self, name: str, kind: ServiceKind, callback: ServiceCallback) -> None:
        """Raise NotAvailable.

        DDS implementations identify requests differently, so a ROS client would not recognise its
        response.

        Args:
            name: name of the service.
            kind: `trigger` or `set_bool`.
            callback: not called.

        Raises:
            NotAvailable: Always.
        """
        raise NotAvailable(
            f"service {name} ({kind}): the backend cyclone has no services",
            hint="run with rclpy: source a ROS 2 installation",
        )

    def parameters(self, found: Mapping[str, Parameter], change: ParametersCallback) -> None:
        """Raise NotAvailable: the parameters of a node are services.

        Args:
            found: parameters by name.
            change: not called.

        Raises:
            NotAvailable: Always.
        """
        raise NotAvailable(
            "parameters: the backend cyclone has none",
            hint="run with rclpy: source a ROS 2 installation",
        )

    def follow_joint_trajectory(self, name: str, executor: Executor) -> ActionServer:
        """Raise NotAvailable: actions are services and topics.

        Args:
            name: name of the action.
            executor: not used.

        Raises:
            NotAvailable: Always.
        """
        raise NotAvailable(
            f"action {name}: the backend cyclone has no actions",
            hint="run with rclpy: source a ROS 2 installation",
        )

    def spin_once(self, timeout: float) -> None:
        """Run the callbacks of all received messages in this thread.

        Args:
            timeout: longest time to wait for the first message [s]; 0 does not wait.
        """
        if self._waitset.wait(duration(seconds=timeout)):
            for subscription in self._subscriptions:
                subscription.deliver()

    def close(self) -> None:
        """Leave the graph. A second call has no effect."""
        if not self._closed:
            self._closed = True
            cyclone_domain.close_participant(self._participant)

    def _topic(self, name: str, message: type[Struct]) -> Topic[Any]:
        return Topic(self._participant, "rt" + name, idl_type(message))

    def _announce(self) -> None:
        """Publish the names of the node and its endpoints."""
        node = discovery.NodeEntitiesInfo(
            self._namespace,
            self._node,
            tuple(_gid(subscription.reader) for subscription in self._subscriptions),
            tuple(_gid(publisher.writer) for publisher in self._publishers),
        )
        info = discovery.ParticipantEntitiesInfo(_gid(self._participant), (node,))
        self._discovery.publish(info)

    def _new_mismatches(self) -> Iterator[str]:
        for publisher in self._publishers:
            policy = cyclone_domain.mismatched_policy(publisher.writer, writer=True)
            if policy:
                yield f"{publisher.topic}: a subscription requests more: {_policy(policy)}"
            if publisher.dropped:
                yield f"{publisher.topic}: dropped messages because a subscription is slow"
        for subscription in self._subscriptions:
            policy = cyclone_domain.mismatched_policy(subscription.reader, writer=False)
            if policy:
                yield f"{subscription.topic}: a publisher offers less: {_policy(policy)}"
            if subscription.undecodable:
                yield subscription.undecodable


def _gid(entity: Any) -> discovery.Gid:
    return discovery.Gid(entity.guid.bytes)


def _policy(number: int) -> str:
    return POLICIES.get(number, f"policy {number}")

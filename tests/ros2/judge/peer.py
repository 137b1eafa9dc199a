"""Node of rclpy that tests command. It runs in an environment of tools/ros2_environments.

It uses nothing of Catenary: ROS 2's own code encodes and decodes the messages.
"""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

import rclpy
from lines import serve
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

RELIABILITY = {"reliable": 1, "best_effort": 2}  # rmw_qos_reliability_policy_t
DURABILITY = {"transient_local": 1, "volatile": 2}


def interface(name: str) -> Any:
    package, kind, title = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), title)


def profile(reliability: str, durability: str, depth: int, deadline: float | None) -> QoSProfile:
    options = {} if deadline is None else {"deadline": Duration(seconds=deadline)}
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy(RELIABILITY[reliability]),
        durability=DurabilityPolicy(DURABILITY[durability]),
        **options,
    )


def to_builtins(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        names = value.get_fields_and_field_types()
        return {name: to_builtins(getattr(value, name)) for name in names}
    if isinstance(value, bytes):
        return value[0]
    if isinstance(value, (str, bool, int, float)):
        return value
    return [to_builtins(item) for item in value]


def fill(message: Any, fields: dict[str, Any]) -> Any:
    types = message.get_fields_and_field_types()
    for name, value in fields.items():
        setattr(message, name, field_value(getattr(message, name), types[name], value))
    return message


def field_value(old: Any, kind: str, value: Any) -> Any:
    if isinstance(value, dict):
        return fill(old, value)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        package, title = kind.removeprefix("sequence<").rstrip(">").split("/")
        element = interface(f"{package}/msg/{title}")
        return [fill(element(), item) for item in value]
    return bytes([value]) if kind == "octet" else value


class Peer:
    """The node with its publishers, received messages and reports."""

    def __init__(self, name: str, namespace: str) -> None:
        rclpy.init(args=[])
        self.node = Node(name, namespace=namespace)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.publishers: dict[str, Any] = {}
        self.received: dict[str, list[Any]] = {}
        self.mismatches: list[str] = []

    def spin(self) -> None:
        self.executor.spin_once(timeout_sec=0.005)

    def subscribe(self, topic: str, type: str, qos: list[Any]) -> None:
        received = self.received.setdefault(topic, [])
        self.node.create_subscription(
            interface(type),
            topic,
            lambda message: received.append(to_builtins(message)),
            profile(*qos),
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self.mismatch),
        )

    def advertise(self, topic: str, type: str, qos: list[Any]) -> None:
        self.publishers[topic] = self.node.create_publisher(
            interface(type),
            topic,
            profile(*qos),
            event_callbacks=PublisherEventCallbacks(incompatible_qos=self.mismatch),
        )

    def mismatch(self, event: Any) -> None:
        self.mismatches.append(event.last_policy_kind.name.lower().removeprefix("rmw_qos_policy_"))

    def publish(self, topic: str, type: str, fields: dict[str, Any]) -> None:
        self.publishers[topic].publish(fill(interface(type)(), fields))

    def flood(self, topic: str, type: str, fields: dict[str, Any], count: int) -> None:
        message = fill(interface(type)(), fields)
        for _ in range(count):
            self.publishers[topic].publish(message)

    def matched(self, topic: str) -> int:
        return int(self.publishers[topic].get_subscription_count())

    def messages(self, topic: str) -> list[Any]:
        return self.received[topic]

    def incompatible(self) -> list[str]:
        return self.mismatches

    def nodes(self) -> list[str]:
        pairs = self.node.get_node_names_and_namespaces()
        return [f"{space.rstrip('/')}/{name}" for name, space in pairs]

    def publishers_of(self, topic: str) -> list[list[str]]:
        infos = self.node.get_publishers_info_by_topic(topic)
        return [
            [f"{i.node_namespace.rstrip('/')}/{i.node_name}", i.topic_type, str(i.topic_type_hash)]
            for i in infos
        ]

    def call(self, name: str, type: str, fields: dict[str, Any]) -> Any:
        kind = interface(type)
        client = self.node.create_client(kind, name)
        client.wait_for_service(timeout_sec=20.0)
        future = client.call_async(fill(kind.Request(), fields))
        self.executor.spin_until_future_complete(future, timeout_sec=20.0)
        return to_builtins(future.result())


def main() -> None:
    peer = Peer(*sys.argv[1:])
    commands = (
        peer.subscribe,
        peer.advertise,
        peer.publish,
        peer.flood,
        peer.matched,
        peer.messages,
        peer.incompatible,
        peer.nodes,
        peer.publishers_of,
        peer.call,
    )
    serve(peer.spin, {command.__name__: command for command in commands})


if __name__ == "__main__":
    main()

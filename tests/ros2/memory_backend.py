"""Backend in memory: published messages are kept, and tests deliver messages and call services."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from msgspec import Struct

from catenary.ros2.backend import (
    STATE,
    Executor,
    NotAvailable,
    Parameter,
    ParametersCallback,
    Qos,
    ServiceCallback,
    ServiceKind,
)


class MemoryPublisher:
    """Publisher that keeps its messages."""

    matched = 1

    def __init__(self, kind: type[Struct], qos: Qos) -> None:
        self.kind, self.qos = kind, qos
        self.messages: list[Any] = []

    def publish(self, message: Struct) -> None:
        assert isinstance(message, self.kind)
        self.messages.append(message)


class MemoryAction:
    """Server of an action that keeps its feedback. Tests use its executor."""

    def __init__(self, name: str, executor: Executor) -> None:
        self.name, self.executor = name, executor
        self.sent: list[tuple[Sequence[str], Sequence[float], Sequence[float]]] = []
        self.steps, self.closed = 0, False

    def step(self) -> None:
        self.steps += 1

    def feedback(
        self, joints: Sequence[str], desired: Sequence[float], actual: Sequence[float]
    ) -> None:
        self.sent.append((joints, desired, actual))

    def close(self) -> None:
        self.closed = True


class MemoryBackend:
    """A node without a network."""

    name: Literal["cyclone", "rclpy"] = "rclpy"

    def __init__(self, *, services: bool = True) -> None:
        self.publishers: dict[str, MemoryPublisher] = {}
        self.subscriptions: dict[str, tuple[type[Struct], Qos, Callable[[Any], None]]] = {}
        self.services: dict[str, ServiceCallback] = {}
        self.declared: dict[str, Parameter] = {}
        self.incompatible: list[str] = []
        self.closed = False
        self._has_services = services
        self._queues: dict[str, list[Struct]] = {}

    def publisher(self, topic: str, message: type[Struct], qos: Qos = STATE) -> MemoryPublisher:
        self.publishers[topic] = MemoryPublisher(message, qos)
        return self.publishers[topic]

    def subscription(
        self, topic: str, message: type[Any], qos: Qos, callback: Callable[[Any], None]
    ) -> None:
        self.subscriptions[topic] = message, qos, callback

    def service(self, name: str, kind: ServiceKind, callback: ServiceCallback) -> None:
        if not self._has_services:
            raise NotAvailable("no services")
        assert kind == "trigger"
        self.services[name] = callback

    def parameters(self, found: Mapping[str, Parameter], change: ParametersCallback) -> None:
        if not self._has_services:
            raise NotAvailable("no parameters")
        self.declared, self.change = dict(found), change

    def follow_joint_trajectory(self, name: str, executor: Executor) -> MemoryAction:
        if not self._has_services:
            raise NotAvailable("no actions")
        self.action = MemoryAction(name, executor)
        return self.action

    def deliver(self, topic: str, message: Struct) -> None:
        """Queue a message, as a network would: the newest `depth` messages are kept."""
        kind, qos, _ = self.subscriptions[topic]
        assert isinstance(message, kind)
        self._queues[topic] = [*self._queues.get(topic, []), message][-qos.depth :]

    def spin_once(self, timeout: float) -> None:
        queues, self._queues = self._queues, {}
        for topic, messages in queues.items():
            for message in messages:
                self.subscriptions[topic][2](message)

    def close(self) -> None:
        self.closed = True

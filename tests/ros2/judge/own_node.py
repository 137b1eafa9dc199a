"""Node of `catenary.ros2.backend` that tests command, with either backend."""

from __future__ import annotations

import sys
from typing import Any

import msgspec
from lines import serve

from catenary.ros2.backend import Qos, open_backend
from catenary.ros2.messages import BY_NAME


class OwnNode:
    """The backend with its publishers and received messages."""

    def __init__(self, kind: Any, name: str, namespace: str) -> None:
        self.backend = open_backend(name, namespace=namespace, kind=kind)
        self.publishers: dict[str, Any] = {}
        self.received: dict[str, list[Any]] = {}
        self.requests: list[bool | None] = []

    def spin(self) -> None:
        self.backend.spin_once(0.005)

    def subscribe(self, topic: str, type: str, qos: list[Any]) -> None:
        received = self.received.setdefault(topic, [])
        struct = BY_NAME[type].struct
        self.backend.subscription(
            topic, struct, Qos(*qos), lambda message: received.append(msgspec.to_builtins(message))
        )

    def advertise(self, topic: str, type: str, qos: list[Any]) -> None:
        self.publishers[topic] = self.backend.publisher(topic, BY_NAME[type].struct, Qos(*qos))

    def publish(self, topic: str, type: str, fields: dict[str, Any]) -> None:
        self.publishers[topic].publish(msgspec.convert(fields, BY_NAME[type].struct))

    def flood(self, topic: str, type: str, fields: dict[str, Any], count: int) -> None:
        message = msgspec.convert(fields, BY_NAME[type].struct)
        for _ in range(count):
            self.publishers[topic].publish(message)

    def matched(self, topic: str) -> int:
        return int(self.publishers[topic].matched)

    def messages(self, topic: str) -> list[Any]:
        return self.received[topic]

    def incompatible(self) -> list[str]:
        return self.backend.incompatible

    def serve(self, name: str, kind: Any, success: bool, message: str) -> None:
        def answer(request: bool | None) -> tuple[bool, str]:
            self.requests.append(request)
            return success, message

        self.backend.service(name, kind, answer)

    def requested(self) -> list[bool | None]:
        return self.requests

    def close(self) -> None:
        self.backend.close()


def main() -> None:
    kind, *names = sys.argv[1:]
    node = OwnNode(kind, *names)
    commands = (
        node.subscribe,
        node.advertise,
        node.publish,
        node.flood,
        node.matched,
        node.messages,
        node.incompatible,
        node.serve,
        node.requested,
    )
    serve(node.spin, {command.__name__: command for command in commands})
    node.close()


if __name__ == "__main__":
    main()

"""Connection to a ROS 2 graph: one interface for two implementations.

`cyclone` needs the package `cyclonedds` (extra `ros2`) and no ROS installation. `rclpy` needs a
sourced ROS 2 environment; services need it too.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal, Protocol, TypeVar

from msgspec import Struct

from catenary.errors import CatenaryError, ConfigurationError
from catenary.ros2 import names

BackendKind = Literal["auto", "cyclone", "rclpy"]
Reliability = Literal["reliable", "best_effort"]
Durability = Literal["volatile", "transient_local"]
ServiceKind = Literal["trigger", "set_bool"]
# The request is None for a trigger. The response is the fields `success` and `message`.
ServiceCallback = Callable[[bool | None], tuple[bool, str]]
Message = TypeVar("Message", bound=Struct)


class NotAvailable(CatenaryError):
    """This backend does not offer the requested function."""


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of a topic. The history is always `keep_last(depth)`.

    A subscription that asks for more than the publisher offers receives nothing:
    `Backend.incompatible` reports it.
    """

    reliability: Reliability = "reliable"
    durability: Durability = "volatile"
    depth: int = 10
    deadline: float | None = None  # [s]

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.depth < 1:
            raise ValueError(f"depth must be at least 1, not {self.depth}")
        if self.deadline is not None and not self.deadline > 0:
            raise ValueError(f"deadline must be positive, not {self.deadline} s")


SENSOR = Qos("best_effort", "volatile", 5)  # rmw_qos_profile_sensor_data
STATE = Qos("reliable", "volatile", 10)  # rmw_qos_profile_default
COMMAND = Qos("reliable", "volatile", 1)  # an old command is obsolete
CLOCK = Qos("best_effort", "volatile", 1)  # rclcpp::ClockQoS


class Publisher(Protocol):
    """Publisher of one topic."""

    @property
    def matched(self) -> int:
        """Number of subscriptions that receive the messages."""

    def publish(self, message: Struct) -> None:
        """Send a message. The call does not wait for the subscribers."""


class Backend(Protocol):
    """Node of a ROS 2 graph. All calls belong to one thread."""

    name: Literal["cyclone", "rclpy"]

    @property
    def incompatible(self) -> list[str]:
        """QoS mismatches with other nodes seen until now, one text for each topic and policy."""

    def publisher(self, topic: str, message: type[Struct], qos: Qos = STATE) -> Publisher:
        """Create a publisher.

        Args:
            topic: name; relative names are in the namespace of the node.
            message: class of `catenary.ros2.messages`.
            qos: offered quality of service.
        """

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

    def service(self, name: str, kind: ServiceKind, callback: ServiceCallback) -> None:
        """Create a service of std_srvs.

        Args:
            name: name; relative names are in the namespace of the node.
            kind: `trigger` or `set_bool`.
            callback: receives the request and returns the response, called by `spin_once`.

        Raises:
            NotAvailable: The backend has no services.
        """

    def spin_once(self, timeout: float) -> None:
        """Run the callbacks of all received messages and requests in this thread.

        Args:
            timeout: longest time to wait for the first of them [s]; 0 does not wait.
        """

    def close(self) -> None:
        """Leave the graph. A second call has no effect."""


def open_backend(
    node: str, *, namespace: str = "", domain: int | None = None, kind: BackendKind = "auto"
) -> Backend:
    """Join a ROS 2 graph as a node.

    Args:
        node: name of the node.
        namespace: namespace of the node, for example "/left".
        domain: ROS domain 0 to 232; None takes the environment variable ROS_DOMAIN_ID, else 0.
        kind: backend; "auto" prefers rclpy where it is importable.

    Raises:
        ValueError: A name, or the domain, is not valid.
        ConfigurationError: The backend is not installed, or it cannot join the graph.
    """
    names.check_node(node, namespace)
    number = names.domain_number(domain)
    if kind == "rclpy" or (kind == "auto" and find_spec("rclpy") is not None):
        return _open_rclpy(node, namespace, number)
    return _open_cyclone(node, namespace, number)


def _open_rclpy(node: str, namespace: str, domain: int) -> Backend:
    if find_spec("rclpy") is None:
        raise ConfigurationError(
            "rclpy is not importable",
            hint="source /opt/ros/DISTRO/setup.bash, with the Python of that distribution",
        )
    from catenary.ros2.rclpy_backend import RclpyBackend

    return RclpyBackend(node, namespace, domain)


def _open_cyclone(node: str, namespace: str, domain: int) -> Backend:
    if find_spec("cyclonedds") is None:
        raise ConfigurationError(
            "neither rclpy nor cyclonedds is importable", hint=missing_hint(platform.machine())
        )
    from catenary.ros2.cyclone import CycloneBackend

    return CycloneBackend(node, namespace, domain)


def missing_hint(machine: str) -> str:
    """Return what to install on a processor architecture (`platform.machine()`)."""
    if machine == "x86_64":
        return "pip install 'catenary[ros2]', or source a ROS 2 installation"
    return f"cyclonedds has no wheel for {machine}; source a ROS 2 installation (rclpy)"

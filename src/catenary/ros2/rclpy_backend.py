"""Backend in a ROS 2 environment: a node of rclpy, with services.

Messages pass as CDR bytes (`catenary.ros2.cdr`), so that both backends send the same bytes and no
field is copied into objects of ROS 2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, Literal

import rclpy
from msgspec import Struct
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from catenary.errors import ConfigurationError, DecodeError
from catenary.ros2 import cdr, names
from catenary.ros2.action import FollowJointTrajectoryServer
from catenary.ros2.interface import (
    STATE,
    Executor,
    Message,
    Parameter,
    ParametersCallback,
    Qos,
    ServiceCallback,
    ServiceKind,
)
from catenary.ros2.messages import message_type
from catenary.ros2.rclpy_parameters import NodeParameters

TAKEN_AT_ONCE = 64  # callbacks that one call of `spin_once` runs at most
RELIABILITY = {
    "reliable": ReliabilityPolicy.RELIABLE,
    "best_effort": ReliabilityPolicy.BEST_EFFORT,
}
DURABILITY = {
    "volatile": DurabilityPolicy.VOLATILE,
    "transient_local": DurabilityPolicy.TRANSIENT_LOCAL,
}


def qos_profile(qos: Qos) -> QoSProfile:
    """Return the policies of an endpoint."""
    options = {} if qos.deadline is None else {"deadline": Duration(seconds=qos.deadline)}
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=qos.depth,
        reliability=RELIABILITY[qos.reliability],
        durability=DURABILITY[qos.durability],
        **options,
    )


def ros_class(name: str) -> Any:
    """Return the class of an interface, for example "sensor_msgs/msg/JointState".

    Raises:
        ConfigurationError: Its package is not installed.
    """
    package, kind, interface = name.split("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), interface)
    except ImportError as error:
        raise ConfigurationError(
            f"the ROS 2 package {package} is not installed",
            hint=f"apt-get install ros-$ROS_DISTRO-{package.replace('_', '-')}",
        ) from error


class RclpyPublisher:
    """Publisher of one topic."""

    def __init__(self, publisher: Any) -> None:
        self._publisher = publisher

    @property
    def matched(self) -> int:
        """Number of subscriptions that receive the messages."""
        return int(self._publisher.get_subscription_count())

    def publish(self, message: Struct) -> None:
        """Send a message."""
        self._publisher.publish(cdr.encode(message))


class RclpyBackend:
    """Node of rclpy. It owns the context, the node and its executor."""

    name: Literal["cyclone", "rclpy"] = "rclpy"

    def __init__(self, node: str, namespace: str, domain: int) -> None:
        """Join a domain.

        Args:
            node: name of the node.
            namespace: namespace of the node.
            domain: number of the domain.
        """
        self._names = (node, names.full_namespace(namespace))
        self._context = Context()
        # The signals belong to the program.
        rclpy.init(
            args=[],
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._node = Node(
            node, namespace=namespace, context=self._context, use_global_arguments=False
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._parameters = NodeParameters(self._node)
        self._reports: dict[str, None] = {}  # a set in the order of insertion
        self._ran = False
        self._closed = False

    @property
    def incompatible(self) -> list[str]:
        """QoS mismatches and undecodable messages seen until now."""
        return list(self._reports)

    def publisher(self, topic: str, message: type[Struct], qos: Qos = STATE) -> RclpyPublisher:
        """Create a publisher.

        Args:
            topic: name; relative names are in the namespace of the node.
            message: class of `catenary.ros2.messages`.
            qos: offered quality of service.
        """
        name = names.resolve(topic, *self._names)
        text = f"{name}: a subscription requests more"
        events = PublisherEventCallbacks(incompatible_qos=self._reporter(text))
        kind = ros_class(message_type(message).name)
        profile = qos_profile(qos)
        return RclpyPublisher(
            self._node.create_publisher(kind, name, profile, event_callbacks=events)
        )

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
        name = names.resolve(topic, *self._names)
        events = SubscriptionEventCallbacks(
            incompatible_qos=self._reporter(f"{name}: a publisher offers less")
        )

        def receive(data: bytes) -> None:
            self._ran = True
            try:
                decoded = cdr.decode(data, message)
            except DecodeError as error:
                self._reports[f"{name}: ignored a message: {error.message}"] = None
            else:
                callback(decoded)

        self._node.create_subscription(
            ros_class(message_type(message).name),
            name,
            receive,
            qos_profile(qos),
            event_callbacks=events,
            raw=True,
        )

    def service(self, name: str, kind: ServiceKind, callback: ServiceCallback) -> None:
        """Create a service of std_srvs.

        Args:
            name: name; relative names are in the namespace of the node.
            kind: `trigger` or `set_bool`.
            callback: receives the request and returns the response, called by `spin_once`.
        """

        def answer(request: Any, response: Any) -> Any:
            self._ran = True
            value = bool(request.data) if kind == "set_bool" else None
            response.success, response.message = callback(value)
            return response

        interface = "std_srvs/srv/SetBool" if kind == "set_bool" else "std_srvs/srv/Trigger"
        full_name = names.resolve(name, *self._names)
        self._node.create_service(ros_class(interface), full_name, answer)

    def parameters(self, found: Mapping[str, Parameter], change: ParametersCallback) -> None:
        """Declare the parameters of the node. A later call replaces them, or their values.

        Args:
            found: all parameters by name.
            change: receives the values of each request to the node, called by `spin_once`.
        """
        self._parameters.show(found, change)

    def follow_joint_trajectory(self, name: str, executor: Executor) -> FollowJointTrajectoryServer:
        """Create a server of the action control_msgs/FollowJointTrajectory.

        Args:
            name: name; relative names are in the namespace of the node.
            executor: executes the goals, called by `spin_once`.

        Raises:
            ConfigurationError: control_msgs is not installed.
        """
        full_name = names.resolve(name, *self._names)
        return FollowJointTrajectoryServer(self._node, full_name, executor)

    def spin_once(self, timeout: float) -> None:
        """Run the callbacks of all received messages and requests in this thread.

        Args:
            timeout: longest time to wait for the first of them [s]; 0 does not wait.
        """
        self._ran = False
        self._executor.spin_once(timeout_sec=timeout)
        for _ in range(TAKEN_AT_ONCE):
            if not self._ran:
                return
            self._ran = False
            self._executor.spin_once(timeout_sec=0)

    def close(self) -> None:
        """Leave the graph. A second call has no effect."""
        if self._closed:
            return
        self._closed = True
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _reporter(self, text: str) -> Callable[[Any], None]:
        def report(event: Any) -> None:
            self._ran = True
            policy = event.last_policy_kind.name.lower().removeprefix("rmw_qos_policy_")
            self._reports[f"{text}: {policy}"] = None

        return report

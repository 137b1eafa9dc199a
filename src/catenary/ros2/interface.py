"""Interface of a node in a ROS 2 graph, and quality of service."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, TypeVar

from msgspec import Struct

from catenary.errors import CatenaryError
from catenary.ros2.goal import Goal
from catenary.ros2.limits import ToleranceLike
from catenary.ros2.waypoints import TrajectoryLike

Reliability = Literal["reliable", "best_effort"]
Durability = Literal["volatile", "transient_local"]
ServiceKind = Literal["trigger", "set_bool"]
# The request is None for a trigger. The response is the fields `success` and `message`.
ServiceCallback = Callable[[bool | None], tuple[bool, str]]
# The argument is the values of one request by name. The result is the reason of a refusal, or "".
ParametersCallback = Callable[[Mapping[str, object]], str]
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
GLOVE = Qos("best_effort", "volatile", 1)  # of sensors, and of reliable publishers
CLOCK = Qos("best_effort", "volatile", 1)  # rclcpp::ClockQoS


@dataclass(frozen=True, slots=True)
class Parameter:
    """Parameter of a node: a number within limits. None: no limit."""

    value: float
    minimum: float | None = None
    maximum: float | None = None
    description: str = ""


class Publisher(Protocol):
    """Publisher of one topic."""

    @property
    def matched(self) -> int:
        """Number of subscriptions that receive the messages."""

    def publish(self, message: Struct) -> None:
        """Send a message. The call does not wait for the subscribers."""


class Executor(Protocol):
    """Execution of the goals of an action: a `TrajectoryFollower` and the source of its state."""

    def start(
        self,
        trajectory: TrajectoryLike,
        path: Sequence[ToleranceLike],
        goal: Sequence[ToleranceLike],
        goal_time: float,
    ) -> Goal:
        """Start a trajectory with the tolerances of `limits.overridden`.

        Raises:
            CatenaryError: The trajectory is refused.
        """

    def cancel(self) -> None:
        """Cancel the goal that is being executed."""


class ActionServer(Protocol):
    """Server of the action FollowJointTrajectory."""

    def step(self) -> None:
        """Send the results of finished goals. Call it after each sample of the follower."""

    def feedback(
        self, joints: Sequence[str], desired: Sequence[float], actual: Sequence[float]
    ) -> None:
        """Send feedback for the executed goals.

        Args:
            joints: names of the joints.
            desired: set-points [rad].
            actual: measured positions [rad].
        """

    def close(self) -> None:
        """Remove the action from the graph."""


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

    def parameters(self, found: Mapping[str, Parameter], change: ParametersCallback) -> None:
        """Declare the parameters of the node. A later call replaces them, or their values.

        Args:
            found: all parameters by name.
            change: receives the values of each request to the node, called by `spin_once`.

        Raises:
            NotAvailable: The backend has no parameters.
        """

    def follow_joint_trajectory(self, name: str, executor: Executor) -> ActionServer:
        """Create a server of the action control_msgs/FollowJointTrajectory.

        Args:
            name: name; relative names are in the namespace of the node.
            executor: executes the goals, called by `spin_once`.

        Raises:
            NotAvailable: The backend has no actions.
            ConfigurationError: control_msgs is not installed.
        """

    def spin_once(self, timeout: float) -> None:
        """Run the callbacks of all received messages and requests in this thread.

        Args:
            timeout: longest time to wait for the first of them [s]; 0 does not wait.
        """

    def close(self) -> None:
        """Leave the graph. A second call has no effect."""

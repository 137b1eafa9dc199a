"""Connection to a ROS 2 graph: one interface for two implementations.

`cyclone` needs the package `cyclonedds` (extra `ros2`) and no ROS installation. `rclpy` needs a
sourced ROS 2 environment; services, parameters and actions need it too.
"""

from __future__ import annotations

import platform
from importlib.util import find_spec
from typing import Literal

from catenary.errors import ConfigurationError
from catenary.ros2 import names
from catenary.ros2.interface import (
    CLOCK,
    COMMAND,
    GLOVE,
    SENSOR,
    STATE,
    ActionServer,
    Backend,
    Executor,
    NotAvailable,
    Parameter,
    ParametersCallback,
    Publisher,
    Qos,
    ServiceCallback,
    ServiceKind,
)

__all__ = [
    "CLOCK",
    "COMMAND",
    "GLOVE",
    "SENSOR",
    "STATE",
    "ActionServer",
    "Backend",
    "BackendKind",
    "Executor",
    "NotAvailable",
    "Parameter",
    "ParametersCallback",
    "Publisher",
    "Qos",
    "ServiceCallback",
    "ServiceKind",
    "missing_hint",
    "open_backend",
]

BackendKind = Literal["auto", "cyclone", "rclpy"]


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

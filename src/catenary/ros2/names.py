"""Names of nodes and topics, and the domain number.

The rules are those of https://design.ros2.org/articles/topic_and_service_names.html.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping

TOKEN = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
PART = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
LAST_DOMAIN = 232  # the ports of a higher domain exceed 65535 (RTPS 2.5 §9.6.2.4)


def check_node(node: str, namespace: str) -> None:
    """Check the name of a node and its namespace.

    Args:
        node: letters, digits and underscores.
        namespace: empty, or such parts, separated by slashes.

    Raises:
        ValueError: A name is not valid.
    """
    if not TOKEN.fullmatch(node):
        raise ValueError(f"invalid node name {node!r}; use letters, digits and '_'")
    if namespace.strip("/"):
        _check_parts(namespace)


def full_namespace(namespace: str) -> str:
    """Return a namespace with its leading slash; "/" if it is empty."""
    return "/" + namespace.strip("/")


def resolve(name: str, node: str, namespace: str) -> str:
    """Return the absolute name of a topic or service.

    Args:
        name: absolute ("/joint_states"), relative ("joint_states") or private ("~/status").
        node: name of the node.
        namespace: namespace of the node.

    Raises:
        ValueError: The name is not valid.
    """
    prefix = full_namespace(namespace).rstrip("/")
    if name.startswith("~/"):
        name = f"{prefix}/{node}/{name[2:]}"
    elif not name.startswith("/"):
        name = f"{prefix}/{name}"
    _check_parts(name)
    return name


def domain_number(domain: int | None, environment: Mapping[str, str] = os.environ) -> int:
    """Return the number of the ROS domain.

    Args:
        domain: number; None takes ROS_DOMAIN_ID, else 0.
        environment: environment variables.

    Raises:
        ValueError: The domain is not a number from 0 to 232.
    """
    text = str(domain) if domain is not None else environment.get("ROS_DOMAIN_ID") or "0"
    if not text.isdecimal() or int(text) > LAST_DOMAIN:
        raise ValueError(f"invalid ROS domain {text!r}; use 0 to {LAST_DOMAIN}")
    return int(text)


def _check_parts(name: str) -> None:
    parts = name.removeprefix("/").split("/")
    if "__" in name or not all(PART.fullmatch(part) for part in parts):
        raise ValueError(
            f"invalid name {name!r}; use letters, digits and single '_', separated by '/'"
        )

"""Tests of the names of nodes and topics and of the domain number."""

from __future__ import annotations

import pytest

from catenary.ros2 import names


@pytest.mark.parametrize(
    ("name", "namespace", "expected"),
    [
        ("joint_states", "", "/joint_states"),
        ("joint_states", "/", "/joint_states"),
        ("joint_states", "left", "/left/joint_states"),
        ("arm/joint_states", "/cell/left/", "/cell/left/arm/joint_states"),
        ("/joint_states", "/left", "/joint_states"),
        ("~/status", "/left", "/left/bridge/status"),
        ("~/status", "", "/bridge/status"),
    ],
)
def test_resolve(name: str, namespace: str, expected: str) -> None:
    assert names.resolve(name, "bridge", namespace) == expected


@pytest.mark.parametrize("name", ["", "/", "a b", "a/", "/a//b", "1a", "a__b", "~", "a/~/b", "é"])
def test_resolve_refuses_an_invalid_name(name: str) -> None:
    with pytest.raises(ValueError, match="invalid name"):
        names.resolve(name, "bridge", "")


def test_check_node_accepts_valid_names() -> None:
    names.check_node("bridge_1", "")
    names.check_node("bridge_1", "/cell/left")


@pytest.mark.parametrize(("node", "space"), [("", ""), ("a/b", ""), ("1a", ""), ("a", "/b c")])
def test_check_node_refuses_an_invalid_name(node: str, space: str) -> None:
    with pytest.raises(ValueError, match="invalid"):
        names.check_node(node, space)


@pytest.mark.parametrize(
    ("domain", "environment", "expected"),
    [
        (None, {}, 0),
        (None, {"ROS_DOMAIN_ID": "7"}, 7),
        (3, {"ROS_DOMAIN_ID": "7"}, 3),
        (232, {}, 232),
    ],
)
def test_domain_number(domain: int | None, environment: dict[str, str], expected: int) -> None:
    assert names.domain_number(domain, environment) == expected


@pytest.mark.parametrize(("domain", "text"), [(-1, ""), (233, ""), (None, "x"), (None, "300")])
def test_domain_number_refuses_an_invalid_domain(domain: int | None, text: str) -> None:
    with pytest.raises(ValueError, match="invalid ROS domain"):
        names.domain_number(domain, {"ROS_DOMAIN_ID": text})

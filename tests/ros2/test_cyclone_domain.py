"""Tests of the configuration of Cyclone DDS."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

from catenary.errors import ConfigurationError

pytest.importorskip("cyclonedds", reason="cyclonedds is not installed")

from catenary.ros2.cyclone_domain import configuration


def domain_of(environment: dict[str, str]) -> ET.Element:
    domain = ET.fromstring(configuration(environment)).find("Domain")
    assert domain is not None
    return domain


def peers_of(domain: ET.Element) -> list[str]:
    return [peer.attrib["Address"] for peer in domain.iter("Peer")]


def test_type_information_of_fast_dds_is_ignored() -> None:
    assert domain_of({}).findtext("Compatibility/IgnoreTypeInformation") == "1.15"


def test_key_hashes_are_sent() -> None:
    assert domain_of({}).findtext("Internal/GenerateKeyhash") == "true"


def test_subnet_is_the_default() -> None:
    assert configuration({}) == configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"})
    domain = domain_of({})
    assert domain.find("General/AllowMulticast") is None
    assert peers_of(domain) == []


@pytest.mark.parametrize(
    "environment", [{"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, {"ROS_LOCALHOST_ONLY": "1"}]
)
def test_localhost_uses_the_loopback_interface(environment: dict[str, str]) -> None:
    domain = domain_of(environment)
    assert domain.findtext("General/AllowMulticast") == "false"
    assert [each.attrib["name"] for each in domain.iter("NetworkInterface")] == ["lo"]
    assert peers_of(domain) == ["localhost"]


def test_static_peers() -> None:
    environment = {"ROS_STATIC_PEERS": "10.0.0.2;robot"}
    assert peers_of(domain_of(environment)) == ["10.0.0.2", "robot"]
    domain = domain_of({**environment, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert peers_of(domain) == ["localhost", "10.0.0.2", "robot"]
    assert list(domain.iter("NetworkInterface")) == []  # the other machine is not on `lo`


def test_off_has_no_peers() -> None:
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF", "ROS_STATIC_PEERS": "10.0.0.2"}
    assert peers_of(domain_of(environment)) == []


def test_a_peer_cannot_change_the_xml() -> None:
    assert peers_of(domain_of({"ROS_STATIC_PEERS": 'a"/><x y="'})) == ['a"/><x y="']


def test_a_configuration_of_the_user_comes_last() -> None:
    assert configuration({"CYCLONEDDS_URI": "file:///a.xml"}).endswith(",file:///a.xml")


def test_refuses_an_unknown_range() -> None:
    with pytest.raises(ConfigurationError, match="'EVERYWHERE'"):
        configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "EVERYWHERE"})

"""DDS domain with a configuration that reaches ROS 2 nodes, and calls that the wheel leaves out.

The binding wraps neither the counters of matches and QoS mismatches nor an explicit end of a
participant. The C functions are called here.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

from cyclonedds.core import DDSException, Entity
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import DDS, dds_c_t
from cyclonedds.qos import Policy, Qos

from catenary.errors import ConfigurationError
from catenary.ros2.discovery import PARTICIPANT_USER_DATA

# 1.15 is the vendor number of eProsima. The type information of Fast DDS 3 (Kilted and newer) is
# not readable for Cyclone DDS, so matching uses the names of the types
# (eclipse-cyclonedds/cyclonedds pull request 2333).
COMPATIBILITY = "<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>"
# Fast DDS recognises the end of a node or endpoint by its key hash, else only after 10 s.
INTERNAL = "<Internal><GenerateKeyhash>true</GenerateKeyhash></Internal>"
INDEX = (
    "<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
)
LOOPBACK = '<Interfaces><NetworkInterface name="lo"/></Interfaces>'
UNICAST = "<AllowMulticast>false</AllowMulticast>"
RANGES = ("SUBNET", "LOCALHOST", "OFF", "SYSTEM_DEFAULT")


def configuration(environment: Mapping[str, str]) -> str:
    """Return the configuration of Cyclone DDS as XML.

    ROS_AUTOMATIC_DISCOVERY_RANGE and ROS_STATIC_PEERS mean the same as for other ROS 2 nodes. A
    configuration in CYCLONEDDS_URI has priority.

    Args:
        environment: environment variables.

    Raises:
        ConfigurationError: ROS_AUTOMATIC_DISCOVERY_RANGE has an invalid value.
    """
    reach = _discovery_range(environment)
    peers = [peer for peer in environment.get("ROS_STATIC_PEERS", "").split(";") if peer]
    general, discovery = "", INDEX
    if reach == "LOCALHOST":
        general, peers = LOOPBACK + UNICAST, ["localhost", *peers]
        if len(peers) > 1:
            general = UNICAST
    elif reach == "OFF":
        general, discovery, peers = (
            LOOPBACK + UNICAST,
            "<ParticipantIndex>none</ParticipantIndex>",
            [],
        )
    if peers:
        discovery += f"<Peers>{''.join(map(_peer, peers))}</Peers>"
    if reach == "SYSTEM_DEFAULT":
        general = discovery = ""
    own = (
        f"<CycloneDDS><Domain><General>{general}</General>"
        f"<Discovery>{discovery}</Discovery>{COMPATIBILITY}{INTERNAL}</Domain></CycloneDDS>"
    )
    return ",".join(filter(None, (own, environment.get("CYCLONEDDS_URI", ""))))


def _peer(address: str) -> str:
    return f"<Peer Address={quoteattr(address)}/>"


def _discovery_range(environment: Mapping[str, str]) -> str:
    if environment.get("ROS_LOCALHOST_ONLY") == "1":
        return "LOCALHOST"
    value = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE") or "SUBNET"
    if value not in RANGES:
        raise ConfigurationError(
            f"ROS_AUTOMATIC_DISCOVERY_RANGE is {value!r}", hint=f"use one of {', '.join(RANGES)}"
        )
    return value


def open_participant(domain: int, config: str) -> DomainParticipant:
    """Join a domain.

    The first participant of a process configures the domain. Others join it as it is.

    Args:
        domain: number of the domain.
        config: configuration as XML.

    Raises:
        ConfigurationError: The domain cannot be joined, for example without a network interface.
    """
    created = _call("dds_create_domain", ctypes.c_uint32(domain), config.encode())
    if created < 0 and created != DDSException.DDS_RETCODE_PRECONDITION_NOT_MET:
        raise _not_joined(domain, DDSException(created, "Occurred while creating the domain"))
    try:
        return DomainParticipant(domain, Qos(Policy.Userdata(PARTICIPANT_USER_DATA)))
    except DDSException as error:
        if created > 0:
            _call("dds_delete", created)
        raise _not_joined(domain, error) from error


def _not_joined(domain: int, error: DDSException) -> ConfigurationError:
    return ConfigurationError(
        f"cannot join ROS domain {domain}: {error}",
        hint="check that a network interface is up (`ip address`), ROS_AUTOMATIC_DISCOVERY_RANGE"
        " and CYCLONEDDS_URI",
    )


def close_participant(participant: DomainParticipant) -> None:
    """Leave the domain, and end it with the last participant of the process."""
    domain_entity = _call("dds_get_parent", participant._ref)
    number = participant.domain_id
    _call("dds_delete", participant._ref)
    if _call("dds_lookup_participant", ctypes.c_uint32(number), None, ctypes.c_size_t(0)) == 0:
        _call("dds_delete", domain_entity)


def matched_subscriptions(writer: Entity) -> int:
    """Return the number of readers that match a writer."""
    status = dds_c_t.publication_matched_status()
    _call("dds_get_publication_matched_status", writer._ref, ctypes.byref(status))
    return int(status.current_count)


def mismatched_policy(endpoint: Entity, *, writer: bool) -> int:
    """Return the number of the QoS policy of the last mismatch; 0 if there was none.

    Args:
        endpoint: reader or writer.
        writer: True if the endpoint is a writer.
    """
    name = f"{'offered' if writer else 'requested'}_incompatible_qos_status"
    status = getattr(dds_c_t, name)()
    _call(f"dds_get_{name}", endpoint._ref, ctypes.byref(status))
    return int(status.last_policy_id) if status.total_count else 0


def _call(function: str, *arguments: Any) -> int:
    result = getattr(DDS._dll_handle, function)(*arguments)
    return 0 if result is None else int(result)

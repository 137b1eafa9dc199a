"""Node information of a DDS participant, as ROS 2 publishes it.

https://design.ros2.org/articles/Node_to_Participant_mapping.html: a participant publishes its nodes
and their endpoints on `ros_discovery_info`. The types are those of rmw_dds_common since Iron.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from msgspec import Struct

from catenary.ros2.messages import Text, message_type

TOPIC = "ros_discovery_info"  # without the prefix "rt/" of ROS topics
PARTICIPANT_USER_DATA = b"enclave=/;"


class Gid(Struct, frozen=True):
    """Global identifier of an endpoint or participant: its GUID."""

    data: Annotated[Sequence[int], "byte[16]"]


class NodeEntitiesInfo(Struct, frozen=True):
    """Node with its endpoints."""

    node_namespace: Text
    node_name: Text
    reader_gid_seq: Sequence[Gid]
    writer_gid_seq: Sequence[Gid]


class ParticipantEntitiesInfo(Struct, frozen=True):
    """Participant with its nodes."""

    gid: Gid
    node_entities_info_seq: Sequence[NodeEntitiesInfo]


PACKAGE = "rmw_dds_common"


def endpoint_user_data(message: type[Struct]) -> bytes:
    """Return the USER_DATA of a reader or writer: the type hash (REP 2016)."""
    return f"typehash={message_type(message).rihs};".encode()

"""Ethernet: the option that gives a virtual device an Ethernet port."""

from __future__ import annotations

from catenary.virtual.eoe.options import EthernetOptions
from catenary.virtual.eoe.server import EOE_PROTOCOL, EthernetServer
from catenary.virtual.protocols import ProtocolServer, Surroundings

ROOM_MIN = 36  # data of a mailbox message: the header and one block [bytes]


class Ethernet(EthernetOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Ethernet port of a virtual device. It answers ARP, ping and HTTP.

    Example: `Servo(protocols=[Ethernet(ip="192.168.7.2")])`. A loss of power restores the addresses
    of the options.
    """

    @property
    def number(self) -> int:
        """Type of the protocol in the mailbox header."""
        return EOE_PROTOCOL

    def start(self, surroundings: Surroundings) -> ProtocolServer:
        """Make the server. Called at each start of the device."""
        if min(surroundings.receive_room, surroundings.send_room) < ROOM_MIN:
            raise ValueError(f"EoE needs a mailbox of at least {ROOM_MIN + 6} bytes")
        return EthernetServer(self, surroundings)

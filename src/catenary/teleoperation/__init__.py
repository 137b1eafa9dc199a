"""Link between two devices for teleoperation: their states over UDP, with a keyed digest.

Submodules contain the packets, the state of the link, a model of a network, and a UDP relay.

    key = teleoperation.read_key("arm.key")
    transport = teleoperation.UdpTransport("0.0.0.0:7001", "follower.local:7002")
    with teleoperation.Peer(transport, key=key, axes=2, max_delay=0.1) as peer:
        sample = peer.receive()  # in every cycle; None: nothing new, or not connected
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from catenary.teleoperation.key import make_key, read_key
    from catenary.teleoperation.link_state import LinkState
    from catenary.teleoperation.network_model import NetworkModel
    from catenary.teleoperation.peer import Peer
    from catenary.teleoperation.sample import PeerSample
    from catenary.teleoperation.transport import Transport, UdpTransport
    from catenary.teleoperation.virtual_transport import VirtualNetwork

__all__ = [
    "LinkState",
    "NetworkModel",
    "Peer",
    "PeerSample",
    "Transport",
    "UdpTransport",
    "VirtualNetwork",
    "make_key",
    "read_key",
]

_MODULES = {
    "LinkState": "link_state",
    "NetworkModel": "network_model",
    "Peer": "peer",
    "PeerSample": "sample",
    "Transport": "transport",
    "UdpTransport": "transport",
    "VirtualNetwork": "virtual_transport",
    "make_key": "key",
    "read_key": "key",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)

"""Links: raw sockets and rings; recorders, replays and fault injectors for any link.

with Recorder(Interface("eth0"), "run.pcapng") as link:
    link.send(frame)
"""

from catenary.link._fault_injector import FaultInjector
from catenary.link._recorder import Recorder
from catenary.link._replay import Replay
from catenary.link._table import capsule_in_virtual_time
from catenary.link.fault import Fault
from catenary.link.fork import forget_in_child
from catenary.link.interface import Interface
from catenary.link.ownership import Ownership, other_sockets
from catenary.link.protocol import Link, LinkSource
from catenary.link.ring import Ring, RingLink, ring_of

__all__ = [
    "Fault",
    "FaultInjector",
    "Interface",
    "Link",
    "LinkSource",
    "Ownership",
    "Recorder",
    "Replay",
    "Ring",
    "RingLink",
    "forget_in_child",
    "lives_in_virtual_time",
    "other_sockets",
    "ring_of",
]


def lives_in_virtual_time(link: Link) -> bool:
    """Return True if the link's clock advances only while its user waits.

    A link written in Python without a table is assumed to use the machine's clock.
    """
    return link.capsule is not None and capsule_in_virtual_time(link.capsule)

"""Cables: raw sockets, and recorders, replays and fault injectors round any link.

with Interface("eth0").open_link() as link:
    link.send(frame)
"""

from catenary.link.interface import Interface
from catenary.link.protocol import Link, LinkSource

__all__ = ["Interface", "Link", "LinkSource"]

"""Mailbox gateway (ETG.8200): vendors' tools reach the devices over UDP and TCP.

with cat.Gateway(main, write=[2]) as gateway: ...
"""

from catenary.gateway.gateway import Gateway as Gateway
from catenary.gateway.limits import GatewayCounts as GatewayCounts

__all__ = ["Gateway", "GatewayCounts"]

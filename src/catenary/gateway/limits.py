"""Limits of the gateway, and its counters."""

from __future__ import annotations

from dataclasses import dataclass

CLIENTS = 8  # connections of TCP, and the same number of UDP clients
OUTSTANDING = 8  # requests of one client without an answer
RATE, BURST = 500.0, 50.0  # messages of one client per second, and after a pause
IDLE_TIMEOUT = 300.0  # [s] until a silent TCP client is disconnected
FRAME_TIMEOUT = 5.0  # [s] until a frame that has begun must be complete
STALL_TIMEOUT = 5.0  # [s] until a client must read
OUTBOX_MAX = 256 << 10  # [bytes] for a client that does not read
LEASE_IDLE = 1.0  # [s] between two messages of one transfer
LEASE_MAX = 120.0  # [s] of one transfer
TURN_TIMEOUT = 10.0  # [s] until the mailbox is free
CLOSE_TIMEOUT = 5.0  # [s] for the threads to end


@dataclass(slots=True)
class GatewayCounts:
    """Counters of a gateway since it was opened."""

    connections: int = 0  # of TCP
    rejected: int = 0  # connections beyond the limit
    disconnected: int = 0  # clients that sent garbage or did not read
    requests: int = 0
    refused: int = 0
    writes: int = 0  # transfers to devices
    invalid: int = 0  # frames that are not valid
    dropped: int = 0  # UDP frames beyond the limits

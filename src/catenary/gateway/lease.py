"""Lease: the right of one client to use a mailbox, for one message or one transfer.

A lease is a ticket in the queue of the mailbox (`MailboxChannel.turns`), so that transfers of the
program and of clients take turns. The ticket is added by the procedure of the first message. It is
removed with the last message, or by any thread while no message is under way. In a loop, a transfer
of the program therefore waits until that of the client ends: at most LEASE_MAX, and LEASE_IDLE if
the client does not continue.

Without a loop, the procedures of all threads run one after another, and one that waits for its turn
stops the others. The ticket is therefore also removed between two messages of a transfer. An SDO
transfer of the program may then come between two SDO segments of a client, and end its transfer.
"""

from __future__ import annotations

import threading
import time

from catenary.gateway.clients import Client
from catenary.gateway.limits import LEASE_IDLE, LEASE_MAX
from catenary.gateway.transfer import Transfer
from catenary.procedure.exchange import Procedure
from catenary.procedure.mailbox import MailboxChannel, turn_comes_for


class Lease:
    """Owner of one ticket in the queue of a mailbox."""

    def __init__(self, channel: MailboxChannel, client: Client | None) -> None:
        self.channel = channel
        self.client = client
        self.transfer: Transfer | None = None  # what the client must continue
        self._ticket = object()
        self._lock = threading.Lock()
        self._running = self._ended = False
        self._began = self._touched = time.monotonic()

    def enter(self) -> bool:
        """Begin an exchange. Return False if the lease has ended."""
        with self._lock:
            if self._ended or time.monotonic() - self._began > LEASE_MAX:
                return False
            self._running = True
            if self._ticket not in self.channel.turns:
                self.channel.turns.append(self._ticket)
            return True

    def turn(self, seconds: float) -> Procedure[bool]:
        """Wait for the turn. Return False if it does not come in time.

        Args:
            seconds: Longest time to wait [s].
        """
        return turn_comes_for(self.channel, self._ticket, seconds)

    def leave(self, *, keep_turn: bool) -> None:
        """End an exchange. The lease continues if a transfer does.

        Args:
            keep_turn: True to keep the turn until the next message of the transfer.
        """
        with self._lock:
            self._running = False
            self._touched = time.monotonic()
            if self.transfer is None or self._ended:
                self._ended = True
            if self._ended or not keep_turn:
                self._release()

    @property
    def is_due(self) -> bool:
        """True if the client has not continued its transfer in time."""
        now = time.monotonic()
        idle = not self._running and now - self._touched > LEASE_IDLE
        return idle or now - self._began > LEASE_MAX

    def end(self) -> Transfer | None:
        """End the lease, after the present exchange if there is one.

        Returns:
            Transfer that the caller must end in the device; None if there is none, or an exchange
            is under way.
        """
        with self._lock:
            self._ended = True
            if self._running:
                return None
            self._release()
            transfer, self.transfer = self.transfer, None
            return transfer

    @property
    def has_ended(self) -> bool:
        """True if the lease has ended, or ends with the present exchange."""
        return self._ended

    def _release(self) -> None:
        if self._ticket in self.channel.turns:
            self.channel.turns.remove(self._ticket)

"""Sequence numbers that were received: a sliding window, as for IPsec (RFC 4303, appendix A2)."""

from __future__ import annotations

from catenary.teleoperation.refusal import Refusal

WIDTH = 64  # packets


class SequenceWindow:
    """Owner of the set of received sequence numbers of one session.

    Only a number above all others is accepted: the latest state is the one that counts. Delays of
    accepted packets therefore never step back in time.
    """

    def __init__(self) -> None:
        self._newest = 0
        self._received = 0  # bit k: number newest - k was received

    def accept(self, sequence: int) -> Refusal | None:
        """Record a number. Return None if it is the newest, or the reason for the refusal.

        A number below the window counts as replayed, because it may have been received before.
        """
        if sequence > self._newest:
            shift = min(sequence - self._newest, WIDTH)
            self._received = ((self._received << shift) | 1) & ((1 << WIDTH) - 1)
            self._newest = sequence
            return None
        bit = 1 << min(self._newest - sequence, WIDTH)
        if bit >> WIDTH or self._received & bit:
            return Refusal.REPLAYED
        self._received |= bit
        return Refusal.LATE

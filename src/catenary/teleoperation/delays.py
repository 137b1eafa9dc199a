"""Delays of a link, from the times in its packets, without synchronised clocks.

Each side notes the age of the other side's state: the time since the sender measured it, until the
receiver uses it. Ages contain the network's delay, jitter, losses, and the hold times between two
cycles. The clocks of the sides differ by an unknown offset. It falsifies the two ages by the same
amount in opposite directions, so that it cancels in their sum:

    age here + offset  = now - sent_ns           (clock here - clock there)
    age there - offset = sent_ns - echo_ns       (clock there - clock here)
    sum of the ages    = now - echo_ns           (clock here only)

The stability condition of P+d needs the sum of the largest delays, `*T_1 + *T_2` (Nuno, Basanez,
Ortega, Automatica 47 (2011) 485-495). With varying delays, it can exceed the largest sum, because
the two maxima occur at different times. The offset cancels in the sum of the maxima as well. The
maxima are taken over a window of 10 s, in which two crystals of 100 ppm drift apart by 2 ms at
most.
"""

from __future__ import annotations

from catenary.teleoperation.sliding_maximum import SlidingMaximum

WINDOW_NS = 10_000_000_000


class Delays:
    """Owner of the ages of one link. All times are in ns."""

    def __init__(self) -> None:
        self._here = SlidingMaximum(WINDOW_NS)
        self._there = SlidingMaximum(WINDOW_NS)
        self._sent_ns = 0
        self._echo_ns: int | None = None
        self.round_trip_ns: int | None = None  # of the last packet, without its hold time

    def receive(self, now_ns: int, sent_ns: int, echo_ns: int, hold_ns: int) -> None:
        """Take over the times of the newest packet.

        Args:
            now_ns: time of this side.
            sent_ns: time of sending, on the other side's clock.
            echo_ns: time of sending of the last packet of this side that the other side received.
            hold_ns: time from that reception to `sent_ns`.
        """
        self._sent_ns, self._echo_ns = sent_ns, echo_ns
        self.round_trip_ns = now_ns - echo_ns - hold_ns
        self._there.add(now_ns, sent_ns - echo_ns)

    def update(self, now_ns: int) -> None:
        """Note the age of the other side's state as it is used now."""
        if self._echo_ns is not None:
            self._here.add(now_ns, now_ns - self._sent_ns)

    def sum_ns(self, now_ns: int) -> int | None:
        """Return the sum of both ages now; None before the first packet."""
        return None if self._echo_ns is None else now_ns - self._echo_ns

    @property
    def bound_ns(self) -> int | None:
        """Sum of the largest ages of the window; None before the first packet."""
        here, there = self._here.value, self._there.value
        return None if here is None or there is None else here + there

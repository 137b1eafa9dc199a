"""Handshake, checks and state of a link, without I/O and without a clock.

Theory of operation. Each program draws a random session number at its start. Every packet carries
the sender's session and the session of the receiver that the sender knows, under one digest. A
packet is *fresh* if it answers this side's session, and echoes a time of sending that is at most
`max_delay` old. Only the other program of this moment can have made such a packet. A recorded
packet answers an old session or echoes an old time, also after a restart of either program.

The first packets answer nothing. They introduce a session, which the other side then answers. A
session is taken over only while the delays are beyond the bound or unknown. A connected link
therefore ignores all other sessions; a restarted program connects after the link is lost.

The link is lost when the sum of the largest delays of both directions in the last 10 s exceeds
`max_delay` (`delays.py`). The delays also grow when packets stop, in either direction, so that this
one bound covers silence, and both sides detect the loss. The link connects, for the first time or
again, when the delays have stayed within the bound for the settling time.
"""

from __future__ import annotations

from catenary.teleoperation.delays import Delays
from catenary.teleoperation.link_state import LinkEvent, LinkState, step
from catenary.teleoperation.packet import Packet
from catenary.teleoperation.refusal import Refusal
from catenary.teleoperation.sample import PeerSample
from catenary.teleoperation.sequence_window import SequenceWindow

SILENT = "no packet of the other side has arrived yet"
UNANSWERED = "packets of the other side arrive, but it has not answered those of this side in time"


class Link:
    """Owner of the state of one side of a link. All times are in ns.

    Args:
        session: random number of this program, not 0.
        max_delay_ns: bound of the sum of both delays.
        settle_ns: time within the bound before the link connects.
    """

    def __init__(self, session: int, *, max_delay_ns: int, settle_ns: int) -> None:
        self.session = session
        self.state = LinkState.WAITING
        self.reason = SILENT
        self.losses = 0
        self.delays = Delays()
        self._max_delay_ns, self._settle_ns = max_delay_ns, settle_ns
        self._other = 0  # session of the other side
        self.proven = 0  # the same, once it has answered this side in time
        self._window = SequenceWindow()
        self._sequence = 0
        self._newest: tuple[int, int] | None = None  # sent there, received here
        self._timely_since: int | None = None
        self._updated_ns: int | None = None
        self.longest_gap_ns = 0  # between two updates

    def packet(self, sample: PeerSample, now_ns: int, *, leaving: bool = False) -> Packet:
        """Return the next packet of this side. It reports `holding` unless the link is connected.

        Args:
            sample: state of this side.
            now_ns: time of sending.
            leaving: True for the last packet.
        """
        self._sequence += 1
        sent, received = self._newest or (0, now_ns)
        if self.state is not LinkState.CONNECTED:
            sample = sample._replace(holding=True)
        numbers = self.session, self._other, self._sequence, now_ns, sent, now_ns - received
        return Packet(*numbers, sample, leaving)

    def accept(self, packet: Packet, now_ns: int) -> Refusal | None:
        """Check a packet with a valid digest. Return None if its sample is usable, or the reason.

        Args:
            packet: the packet.
            now_ns: time of reception.
        """
        refusal = self._admit(packet)
        if refusal is not None:
            return refusal
        self._newest = packet.sent_ns, now_ns
        if packet.answers != self.session:
            return Refusal.UNPROVEN
        if not 0 <= now_ns - packet.echo_ns <= self._max_delay_ns:
            return Refusal.DELAYED
        if packet.leaving:
            self._lose("the other program has ended")
            return None
        self.proven = packet.session
        self.delays.receive(now_ns, packet.sent_ns, packet.echo_ns, packet.hold_ns)
        return None

    def _admit(self, packet: Packet) -> Refusal | None:
        """Check the session and the sequence number of a packet."""
        if packet.session == self.session:
            return Refusal.REFLECTED
        if packet.session != self._other:
            if self._timely_since is not None:
                return Refusal.SESSION
            self._other, self._window = packet.session, SequenceWindow()
            self.delays = Delays()  # the clock of another program may have another offset
        return self._window.accept(packet.sequence)

    def update(self, now_ns: int) -> LinkState:
        """Return the state of the link in this cycle, after all packets were accepted."""
        gap = now_ns - (self._updated_ns if self._updated_ns is not None else now_ns)
        self._updated_ns = now_ns
        self.longest_gap_ns = max(self.longest_gap_ns, gap)
        self.delays.update(now_ns)
        total, bound = self.delays.sum_ns(now_ns), self.delays.bound_ns
        if total is None or bound is None:
            if self.state is LinkState.WAITING and self._newest:
                self.reason = UNANSWERED
            return self.state
        if bound > self._max_delay_ns:  # never less than the sum of the ages now
            self._lose(self._explain(now_ns, total, bound, gap))
            return self.state
        if self._timely_since is None:
            self._timely_since = now_ns
        steady = now_ns - self._timely_since >= self._settle_ns
        self.state = step(self.state, LinkEvent.STEADY if steady else LinkEvent.TIMELY)
        if self.state is LinkState.CONNECTED:
            self.reason = ""
        return self.state

    def _lose(self, reason: str) -> None:
        self._timely_since = None
        self.delays = Delays()
        if self.state is LinkState.CONNECTED:
            self.losses += 1
        if self.state is not LinkState.LOST:
            self.reason = reason
        self.state = step(self.state, LinkEvent.OVERDUE)

    def _explain(self, now_ns: int, total: int, bound: int, gap: int) -> str:
        limit = f"bound {self._max_delay_ns * 1e-6:.1f} ms"
        silence = now_ns - self._newest[1] if self._newest else 0
        newest = f"the newest packet came {silence * 1e-6:.1f} ms ago"
        if gap > self._max_delay_ns:
            return f"this program did not call receive for {gap * 1e-6:.1f} ms, {limit}"
        if total <= self._max_delay_ns:
            return f"the largest delays of 10 s sum to {bound * 1e-6:.1f} ms, {limit}; {newest}"
        if silence > self._max_delay_ns // 2:
            return f"no packet for {silence * 1e-6:.1f} ms, {limit} of the sum of both delays"
        return (
            f"the sum of the delays is {total * 1e-6:.1f} ms, {limit}; {newest}: the network is "
            "slow, or packets of this side do not arrive"
        )

"""One side of a teleoperation link: sends its state, and receives that of the other side.

key = teleoperation.read_key("arm.key")
transport = teleoperation.UdpTransport("0.0.0.0:7001", "follower.local:7002")
with teleoperation.Peer(transport, key=key, axes=2, max_delay=0.1) as peer:
    for cycle in loop:
        sample = peer.receive()  # None: nothing new, or not connected
        peer.send(teleoperation.PeerSample(arm.actual.position, arm.actual.velocity, force))
"""

from __future__ import annotations

import logging
import secrets
from collections import Counter
from types import TracebackType
from typing import Self

from catenary.teleoperation.link import Link
from catenary.teleoperation.link_state import LinkState
from catenary.teleoperation.packet import Codec
from catenary.teleoperation.refusal import ADVICE, Refusal
from catenary.teleoperation.sample import PeerSample
from catenary.teleoperation.transport import Transport

BURST = 32  # packets that one call of `receive` reads at most
REPORT_NS = 10_000_000_000  # between two reports of the same reason; age of a refusal in `reason`
DELAY_MAX = 10.0  # [s]

log = logging.getLogger("catenary.teleoperation")


class Peer:
    """Owner of one side of a link. Call `receive` and `send` once per cycle, from one thread.

    Args:
        transport: path to the other side. The peer closes it.
        key: secret key of 32 bytes, see `read_key`.
        axes: number of axes, the same on both sides.
        max_delay: bound of the sum of both delays [s], including jitter and hold times. Beyond it,
            the link is lost. It is the bound for the stability condition of the coupling.
        settle: time within the bound before the link connects [s]; None: `max_delay`.

    Raises:
        ValueError: a number is out of range, or the key has another length.
    """

    def __init__(
        self,
        transport: Transport,
        *,
        key: bytes,
        axes: int,
        max_delay: float,
        settle: float | None = None,
    ) -> None:
        settle = max_delay if settle is None else settle
        if not 0.0 < max_delay <= DELAY_MAX or not 0.0 <= settle <= DELAY_MAX:
            raise ValueError(
                f"max_delay {max_delay:g} s and settle {settle:g} s: must be positive, and at most "
                f"{DELAY_MAX:g} s"
            )
        self._codec = Codec(key, axes)
        self._transport = transport
        self._link = Link(
            secrets.randbits(64) or 1,
            max_delay_ns=round(max_delay * 1e9),
            settle_ns=round(settle * 1e9),
        )
        self._counted: Counter[str] = Counter()
        self._report_from: dict[Refusal, int] = {}
        self._refused: Refusal | None = None  # newest one that needs advice, while not connected
        self._refused_ns = 0
        self._newest: PeerSample | None = None  # of the last packet that was used
        self._zeros = PeerSample(*((0.0,) * axes,) * 3)

    @property
    def state(self) -> LinkState:
        """State of the link after the last call of `receive`."""
        return self._link.state

    @property
    def reason(self) -> str:
        """Reason why the link is not connected; empty if it is."""
        reason = self._link.reason
        now_ns = self._transport.now_ns
        if not reason or self._refused is None or now_ns - self._refused_ns > REPORT_NS:
            return reason
        return f"{reason}; packets are refused: {self._refused.value}; {ADVICE[self._refused]}"

    @property
    def losses(self) -> int:
        """Number of losses of the link."""
        return self._link.losses

    @property
    def other_session(self) -> int:
        """Random number of the other program, which changes if it restarts; 0 before its answer."""
        return self._link.proven

    @property
    def delay(self) -> float | None:
        """Sum of both delays now [s], including hold times; None if unknown."""
        return _seconds(self._link.delays.sum_ns(self._transport.now_ns))

    @property
    def delay_bound(self) -> float | None:
        """Sum of the largest delay of each direction in the last 10 s [s]; None if unknown."""
        return _seconds(self._link.delays.bound_ns)

    @property
    def round_trip(self) -> float | None:
        """Round trip of the network [s] without hold times, of the newest packet; None: unknown."""
        return _seconds(self._link.delays.round_trip_ns)

    @property
    def longest_gap(self) -> float:
        """Longest time between two calls of `receive` [s]: lateness of this program."""
        return self._link.longest_gap_ns * 1e-9

    @property
    def counters(self) -> dict[str, int]:
        """Packets since the start: `sent`, `unsent`, `received`, `used`, and each refusal."""
        names = ("sent", "unsent", "received", "used", *(each.name.lower() for each in Refusal))
        return {name: self._counted[name] for name in names}

    def send(self, sample: PeerSample) -> None:
        """Send the state of this side. Raises ValueError if a value is not finite or is missing."""
        self._send(sample, leaving=False)

    def receive(self) -> PeerSample | None:
        """Return the newest state of the other side.

        None if none has arrived since the last call, or the link is not connected. The call that
        connects the link always returns a state, so that a program never continues with one from
        before a loss. The call never waits, and reads at most 32 packets.
        """
        now_ns = self._transport.now_ns
        newest, before = None, self._link.state
        for _ in range(BURST):
            data = self._transport.receive()
            if data is None:
                break
            newest = self._use(data, now_ns) or newest
        self._newest = newest or self._newest
        state = self._link.update(now_ns)
        if state is not before:
            self._report_state(before)
        if state is not LinkState.CONNECTED:
            return None
        return newest if before is LinkState.CONNECTED else self._newest

    def _use(self, data: bytes, now_ns: int) -> PeerSample | None:
        """Return the sample of a packet; None if it is refused."""
        self._counted["received"] += 1
        packet = self._codec.decode(data)
        if isinstance(packet, Refusal):
            self._refuse(packet, now_ns)
            return None
        refusal = self._link.accept(packet, now_ns)
        if refusal is not None:
            self._refuse(refusal, now_ns)
            return None
        self._counted["used"] += 1
        return packet.sample

    def _refuse(self, refusal: Refusal, now_ns: int) -> None:
        """Count a refusal, and report it if it was not reported recently."""
        name = refusal.name.lower()
        self._counted[name] += 1
        if refusal not in ADVICE:
            return
        if refusal is not Refusal.REPLAYED:  # duplicates do not prevent a connection
            self._refused, self._refused_ns = refusal, now_ns
        if now_ns < self._report_from.get(refusal, now_ns):
            return
        self._report_from[refusal] = now_ns + REPORT_NS
        log.warning(
            "packet refused: %s (%d so far)\n  hint: %s",
            refusal.value,
            self._counted[name],
            ADVICE[refusal],
        )

    def _report_state(self, before: LinkState) -> None:
        self._refused = None
        if self.state is LinkState.CONNECTED:
            log.info("teleoperation link connected, delays %.1f ms", 1e3 * (self.delay or 0.0))
        elif before is LinkState.CONNECTED:
            log.warning("teleoperation link lost: %s", self.reason)

    def _send(self, sample: PeerSample, *, leaving: bool) -> None:
        packet = self._link.packet(sample, self._transport.now_ns, leaving=leaving)
        sent = self._transport.send(self._codec.encode(packet))
        self._counted["sent" if sent else "unsent"] += 1

    def close(self) -> None:
        """Report to the other side that this program ends, and close the transport."""
        self._send(self._zeros, leaving=True)
        self._transport.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _seconds(time_ns: int | None) -> float | None:
    return None if time_ns is None else time_ns * 1e-9

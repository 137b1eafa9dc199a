"""Two peers over a virtual network, in steps of 1 ms."""

from __future__ import annotations

from collections.abc import Callable

from catenary.teleoperation import LinkState, NetworkModel, Peer, PeerSample, VirtualNetwork

KEY, OTHER_KEY = bytes(range(32)), bytes(32)
SAMPLE = PeerSample((0.1, -0.2), (1.0, 2.0), (0.0, 0.5))
MS = 1_000_000
OFFSETS_NS = 7 * 10**12, -(10**9)


class Clock:
    now_ns = 0


class Tapped:
    """Transport that keeps all datagrams, can drop what it sends, and can receive injected ones."""

    def __init__(self, inner: object, offset_ns: int = 0) -> None:
        self.inner = inner
        self.offset_ns = offset_ns  # of this side's clock
        self.sent: list[bytes] = []
        self.injected: list[bytes] = []
        self.deaf = self.mute = False

    @property
    def now_ns(self) -> int:
        return self.inner.now_ns + self.offset_ns

    def send(self, data: bytes) -> bool:
        self.sent.append(data)
        return True if self.mute else self.inner.send(data)

    def receive(self) -> bytes | None:
        if self.injected:
            return self.injected.pop(0)
        data = self.inner.receive()
        return None if self.deaf else data

    def close(self) -> None:
        self.inner.close()


class Sides:
    """Two peers with clocks that differ, and a virtual network between them."""

    def __init__(self, model: NetworkModel | None = None, **options: object) -> None:
        self.clock = Clock()
        self.network = VirtualNetwork(model or NetworkModel())
        self.options = {"key": KEY, "axes": 2, "max_delay": 0.02, **options}
        self.received: list[list[PeerSample | None]] = [[], []]
        self.transports = [self._transport(0), self._transport(1)]
        self.peers = [Peer(each, **self.options) for each in self.transports]

    def _transport(self, number: int) -> Tapped:
        return Tapped(self.network.side(number, self.clock), OFFSETS_NS[number])

    @property
    def states(self) -> tuple[LinkState, ...]:
        return tuple(peer.state for peer in self.peers)

    def restart(self, number: int, **options: object) -> None:
        """Replace a peer by one of a new program, as after a crash."""
        old = self.transports[number]
        self.transports[number] = Tapped(old.inner, OFFSETS_NS[number])
        self.peers[number] = Peer(self.transports[number], **{**self.options, **options})

    def run(self, milliseconds: int, silent: tuple[int, ...] = ()) -> None:
        for _ in range(milliseconds):
            self.clock.now_ns += MS
            for number, peer in enumerate(self.peers):
                if number not in silent:
                    self.received[number].append(peer.receive())
                    peer.send(SAMPLE)

    def run_until(self, reached: Callable[[], bool], limit: int = 1000) -> int:
        for count in range(limit):
            if reached():
                return count
            self.run(1)
        raise AssertionError(f"not reached within {limit} ms: {self.states}")

    def connect(self) -> None:
        self.run_until(lambda: self.states == (LinkState.CONNECTED, LinkState.CONNECTED))

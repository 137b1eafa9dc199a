"""Transport in virtual time, between two sides in one process or in two tasks.

    network = VirtualNetwork(NetworkModel(delay=0.1, loss=0.05, seed=1))
    leader = Peer(network.side(0, clock), key=key, axes=2, max_delay=0.3)
    follower = Peer(network.side(1, clock), key=key, axes=2, max_delay=0.3)

The two sides of a `VirtualNetwork` may also be made in two tasks, which receive it as an argument.
"""

from __future__ import annotations

import heapq
from typing import Protocol

from catenary.realtime import Queue
from catenary.teleoperation.network_model import NetworkModel
from catenary.teleoperation.packet import SIZE_MAX

LENGTH = 16_384  # packets on their way: 8 s at 2 kHz
RECORD = [("arrival_ns", "<i8"), ("size", "<i4"), ("data", f"V{SIZE_MAX}")]


class Clock(Protocol):
    """A clock, such as a `VirtualClock` or one of its participants."""

    @property
    def now_ns(self) -> int:
        """Time [ns]."""


class VirtualNetwork:
    """Owner of the packets on their way in both directions.

    Args:
        model: behaviour of the network.
    """

    def __init__(self, model: NetworkModel) -> None:
        self._model = model
        self._queues = tuple(Queue(RECORD, length=LENGTH) for _ in range(2))

    def side(self, number: int, clock: Clock) -> VirtualTransport:
        """Return the transport of one side. Make each side once.

        Args:
            number: 0 or 1.
            clock: virtual clock of the program.

        Raises:
            ValueError: `number` is neither 0 nor 1.
        """
        if number not in (0, 1):
            raise ValueError(f"side {number}: a network has the sides 0 and 1")
        queues = self._queues[number], self._queues[1 - number]
        return VirtualTransport(queues, self._model, number, clock)


class VirtualTransport:
    """One side of a virtual network.

    A packet arrives after its time of sending, never at the same time. The order in which the sides
    run at one virtual time is then without effect, and the same seed gives the same result.

    Args:
        queues: queues to and from the other side.
        model: behaviour of the network.
        number: number of the side.
        clock: virtual clock of the program.
    """

    def __init__(
        self, queues: tuple[Queue, Queue], model: NetworkModel, number: int, clock: Clock
    ) -> None:
        self._out, self._in = queues
        self._direction = model.direction(number)
        self._clock = clock
        self._arriving: list[tuple[int, int, bytes]] = []  # heap of arrival, number, data
        self._count = 0

    @property
    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self._clock.now_ns

    def send(self, data: bytes) -> bool:
        """Send a packet through the model. Return False if too many packets are on their way."""
        padded = data.ljust(SIZE_MAX, b"\0")
        arrivals = self._direction.arrivals(self.now_ns)
        return all([self._out.put((each, len(data), padded)) for each in arrivals])

    def receive(self) -> bytes | None:
        """Return the packet that has arrived first; None if there is none."""
        self._take()
        if not self._arriving or self._arriving[0][0] >= self.now_ns:
            return None
        return heapq.heappop(self._arriving)[2]

    def _take(self) -> None:
        while (record := self._in.take()) is not None:
            arrival, size, data = record.item()
            self._count += 1
            heapq.heappush(self._arriving, (arrival, self._count, data[:size]))

    def close(self) -> None:
        """Do nothing: the network owns the queues."""

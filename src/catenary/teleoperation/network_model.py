"""Model of a network path with delay, jitter, loss, reordering and duplicates, without I/O."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

NS = 1e9
LONGEST = 60.0  # [s]
NODE_NS = 50_000_000


@dataclass(frozen=True, slots=True)
class NetworkModel:
    """Behaviour of a network in each of its two directions.

    The delay wanders within `delay` to `delay + jitter`, linearly between random values at every
    50 ms: consecutive packets of a real network have similar delays. Packets keep their order. A
    reordered packet arrives later by at most `reorder_time`, and others overtake it. With
    tc-netem(8), it has no delay at all, so that one packet makes all those on their way late. The
    same seed and times of sending give the same arrivals.

    Args:
        delay: smallest delay [s].
        jitter: range of the additional delay [s].
        loss: probability that a packet is lost.
        reorder: probability that later packets may overtake a packet.
        duplicate: probability that a packet arrives a second time, as late as a reordered one.
        outages: start and end of times without any packet [s], counted from the first packet.
        seed: seed of the random numbers.
        reorder_time: additional delay of a reordered packet at most [s].

    Raises:
        ValueError: a number is out of range.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    reorder: float = 0.0
    duplicate: float = 0.0
    outages: Sequence[tuple[float, float]] = ()
    seed: int = 0
    reorder_time: float = 0.01

    def __post_init__(self) -> None:
        for name in ("loss", "reorder", "duplicate"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} {getattr(self, name)}: a probability is within 0 to 1")
        for name in ("delay", "jitter", "reorder_time"):
            if not 0.0 <= getattr(self, name) <= LONGEST:
                raise ValueError(f"{name} {getattr(self, name)} s: use 0 to {LONGEST:g} s")
        if any(not start < end for start, end in self.outages):
            raise ValueError(f"outages {self.outages}: each start must be before its end")

    def direction(self, number: int) -> Direction:
        """Return the state of one direction, 0 or 1, with random numbers of its own."""
        return Direction(self, number)


class Direction:
    """Owner of the random numbers and the order of one direction."""

    def __init__(self, model: NetworkModel, number: int) -> None:
        self._model = model
        self._random = random.Random(2 * model.seed + number)
        self._wander = Wander(2 * model.seed + number)
        self._first_ns: int | None = None
        self._last_ns = 0  # latest arrival of a packet in order

    def arrivals(self, sent_ns: int) -> list[int]:
        """Return the arrival times [ns] of a packet: none if it is lost, two if it is repeated.

        The number of random numbers per packet is fixed. Changing one property of the model
        therefore leaves the others at the same packets.
        """
        lost, overtaken, twice, first, second = (self._random.random() for _ in range(5))
        if self._first_ns is None:
            self._first_ns = sent_ns
        elapsed_ns = sent_ns - self._first_ns
        delay = self._model.delay + self._model.jitter * self._wander.value(elapsed_ns)
        if lost < self._model.loss or self._in_outage(elapsed_ns / NS):
            return []
        found = [max(self._last_ns, sent_ns + round(delay * NS))]
        if overtaken < self._model.reorder:
            found[0] += self._more_ns(first)
        else:
            self._last_ns = found[0]
        if twice < self._model.duplicate:
            found.append(found[0] + self._more_ns(second))
        return found

    def _more_ns(self, number: float) -> int:
        return round(number * self._model.reorder_time * NS)

    def _in_outage(self, seconds: float) -> bool:
        return any(start <= seconds < end for start, end in self._model.outages)


class Wander:
    """Owner of a random function of time with values within 0 to 1, linear between its nodes."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(f"wander {seed}")
        self._node = 0
        self._values = self._random.random(), self._random.random()  # at this node, at the next

    def value(self, time_ns: int) -> float:
        """Return the value at a time [ns], which must not step back to before the last node."""
        node, rest = divmod(time_ns, NODE_NS)
        while self._node < node:
            self._node += 1
            self._values = self._values[1], self._random.random()
        before, after = self._values
        return before + (after - before) * rest / NODE_NS

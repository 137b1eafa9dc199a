"""UDP relay that delays, drops, reorders and repeats packets, to test a link without a network.

    python -m catenary.teleoperation.relay 127.0.0.1:7101=127.0.0.1:7001 \\
        127.0.0.1:7102=127.0.0.1:7002 --delay 0.1 --jitter 0.02 --loss 0.05 --seed 1

Each argument is the relay's address for one side, and the address of that side. The leader binds
port 7001 and sends to 7101; the follower binds 7002 and sends to 7102.
"""

from __future__ import annotations

import argparse
import heapq
import select
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import fields

from catenary.errors import CatenaryError
from catenary.teleoperation.network_model import NetworkModel
from catenary.teleoperation.transport import UdpTransport

NS = 1_000_000_000
LONGEST_WAIT_NS = NS // 10
READS = 1000  # packets of each side that one step reads at most
WAITING_MAX = 100_000  # packets on their way; more are dropped


class Relay:
    """Owner of the sockets to both sides, and of the packets on their way.

    Args:
        sides: transports to the two sides.
        model: behaviour of the network.
    """

    def __init__(self, sides: tuple[UdpTransport, UdpTransport], model: NetworkModel) -> None:
        self._sides = sides
        self._directions = model.direction(0), model.direction(1)
        self._waiting: list[tuple[int, int, int, bytes]] = []  # arrival, number, target, data
        self.received = 0
        self.forwarded = 0

    @property
    def waiting(self) -> int:
        """Number of packets on their way."""
        return len(self._waiting)

    def step(self, now_ns: int) -> None:
        """Read the packets that have come, and forward those that are due."""
        for number in range(len(self._sides)):
            self._read(number, now_ns)
        while self._waiting and self._waiting[0][0] <= now_ns:
            _arrival, _count, target, data = heapq.heappop(self._waiting)
            self.forwarded += self._sides[target].send(data)

    def _read(self, number: int, now_ns: int) -> None:
        """Read packets of one side. A flood neither blocks the relay nor fills its memory."""
        for _ in range(READS):
            data = self._sides[number].receive()
            if data is None:
                return
            self.received += 1
            for arrival in self._directions[number].arrivals(now_ns):
                if len(self._waiting) < WAITING_MAX:
                    heapq.heappush(self._waiting, (arrival, self.received, 1 - number, data))

    def run(self, until_ns: int | None = None) -> None:
        """Relay until CLOCK_MONOTONIC reaches a time [ns], or for ever."""
        poll = select.poll()
        for side in self._sides:
            poll.register(side.fileno(), select.POLLIN)
        while until_ns is None or time.monotonic_ns() < until_ns:
            now_ns = time.monotonic_ns()
            self.step(now_ns)
            due_ns = self._waiting[0][0] if self._waiting else now_ns + LONGEST_WAIT_NS
            due_ns = min(due_ns, now_ns + LONGEST_WAIT_NS)
            poll.poll(max(due_ns - time.monotonic_ns(), 0) / 1e6)


def side(text: str) -> UdpTransport:
    """Return the transport for RELAY=SIDE, two addresses."""
    bind, equals, remote = text.partition("=")
    if not equals:
        raise ValueError(f"{text!r}: write RELAY=SIDE, such as 127.0.0.1:7101=127.0.0.1:7001")
    return UdpTransport(bind, remote)


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m catenary.teleoperation.relay",
        description="Relay the UDP packets of two programs, with delay, jitter and loss.",
    )
    help_of_sides = "address of the relay, and of this side: HOST:PORT=HOST:PORT"
    parser.add_argument("sides", nargs=2, metavar="RELAY=SIDE", help=help_of_sides)
    for name, text in (
        ("delay", "smallest delay of each direction [s]"),
        ("jitter", "additional delay at most [s]"),
        ("loss", "probability that a packet is lost"),
        ("reorder", "probability that later packets may overtake a packet"),
        ("duplicate", "probability that a packet arrives twice"),
    ):
        parser.add_argument(f"--{name}", type=float, default=0.0, metavar="N", help=text)
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the random numbers"
    )
    parser.add_argument("--seconds", type=float, metavar="S", help="run time (default: for ever)")
    return parser.parse_args(words)


def main(words: Sequence[str]) -> int:
    """Run the relay until its time has passed, or Ctrl-C or SIGTERM ends it."""
    arguments = parse(words)
    names = {field.name for field in fields(NetworkModel)} & set(vars(arguments))
    try:
        model = NetworkModel(**{name: getattr(arguments, name) for name in names})
        one, other = map(side, arguments.sides)
    except (ValueError, CatenaryError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    relay = Relay((one, other), model)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    seconds = arguments.seconds
    print(f"relay at {one.address} and {other.address}", flush=True)
    try:
        relay.run(None if seconds is None else time.monotonic_ns() + round(seconds * NS))
    except KeyboardInterrupt:
        pass
    finally:
        one.close()
        other.close()
    print(f"received {relay.received}, forwarded {relay.forwarded} packets")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""`python -m benchmarks.teleoperation_link`: time that a teleoperation link takes per cycle.

Two peers in this process exchange packets over UDP on the loopback interface. The time of `receive`
and `send` of one of them is measured, with one packet in each cycle.
"""

from __future__ import annotations

import argparse
import select
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.teleoperation import Peer, PeerSample, UdpTransport

AXES, CYCLES = (2, 16), 20_000
LIMIT_US = 50.0
SECONDS = 1.0  # timeout of a packet
MAX_DELAY = 10.0  # [s], the largest: a pause of this machine is not a loss


@dataclass(frozen=True, slots=True)
class Cost:
    """Time of `receive` and `send` together [us]."""

    axes: int
    cycles: int
    used: int  # packets of the other side that were used
    median_us: float
    p99_us: float


def measure(axes: int, cycles: int) -> Cost:
    """Measure one side of a link.

    Args:
        axes: Number of axes.
        cycles: Number of measured cycles.
    """
    one, other = transports()
    key, sample = bytes(32), PeerSample(*(np.linspace(0.0, 1.0, axes),) * 3)
    took = np.empty(cycles)
    ours, theirs = (
        Peer(each, key=key, axes=axes, max_delay=MAX_DELAY, settle=0.0) for each in (one, other)
    )
    with ours, theirs:
        for number in range(cycles):
            theirs.receive()
            theirs.send(sample)
            select.select([one], [], [], SECONDS)
            start = time.perf_counter_ns()
            ours.receive()
            ours.send(sample)
            took[number] = time.perf_counter_ns() - start
            select.select([other], [], [], SECONDS)
        used = ours.counters["used"]
    median, p99 = (float(np.quantile(took, each)) * 1e-3 for each in (0.5, 0.99))
    return Cost(axes, cycles, used, round(median, 2), round(p99, 2))


def transports() -> tuple[UdpTransport, UdpTransport]:
    """Return two connected transports at free ports."""
    ports = []
    for _ in range(2):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
            made.bind(("127.0.0.1", 0))
            ports.append(made.getsockname()[1])
    one, other = (f"127.0.0.1:{port}" for port in ports)
    return UdpTransport(one, other), UdpTransport(other, one)


def main(words: Sequence[str]) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.teleoperation_link",
        description="Measure the time that a teleoperation link takes per cycle.",
    )
    parser.add_argument("--cycles", type=int, default=CYCLES, metavar="N")
    parser.add_argument("--json", type=Path, metavar="FILE")
    arguments = parser.parse_args(words)
    costs = [measure(axes, arguments.cycles) for axes in AXES]
    print(f"{machine()}\nreceive and send of a peer, limit {LIMIT_US:g} us")
    for each in costs:
        verdict = "reached" if each.median_us <= LIMIT_US else "NOT REACHED"
        print(
            f"  {each.axes:2} axes: median {each.median_us:.1f} us, p99 {each.p99_us:.1f} us, "
            f"{each.used} of {each.cycles} packets used: {verdict}"
        )
    write(arguments.json, {"limit_us": LIMIT_US, "costs": [asdict(each) for each in costs]})


if __name__ == "__main__":
    main(sys.argv[1:])

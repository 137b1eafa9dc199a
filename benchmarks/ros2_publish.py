"""`python -m benchmarks ros2`: time to encode and to publish one JointState.

A node in another process subscribes over the loopback interface, so that the time to publish
includes sending the datagram.
"""

from __future__ import annotations

import os
import select
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from benchmarks.needed import need
from catenary.bench.loop import write
from catenary.bench.report import machine
from catenary.errors import CatenaryError
from catenary.ros2 import cdr
from catenary.ros2.backend import STATE, Backend, Publisher, open_backend
from catenary.ros2.messages import Header, JointState, Time

CALLS = 2000
TOPIC = "joint_states"
DISCOVERY_SECONDS = 20.0
LOOPBACK = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def measure(*, axes: int, file: Path | None) -> None:
    need("cyclonedds")
    figures: dict[str, object] = {"machine": machine(), "axes": axes}
    print(f"{machine()}\nJointState of {axes} axes, {CALLS} calls\n")
    for name, times in measure_times(axes).items():
        p50, p99 = statistics.median(times), statistics.quantiles(times, n=100)[98]
        print(f"  {name:8} p50 {p50:6.1f} us, p99 {p99:6.1f} us")
        figures[name] = {"p50": round(p50, 2), "p99": round(p99, 2)}  # [us]
    write(file, figures)


def measure_times(axes: int) -> dict[str, list[float]]:
    """Return the times of each call [us]."""
    numbers = tuple(0.1 * axis for axis in range(axes))
    names = tuple(f"joint_{axis}" for axis in range(axes))

    def message() -> JointState:
        stamp = Time.from_ns(time.time_ns())
        return JointState(Header(stamp), names, numbers, numbers, numbers)

    with patch.dict(os.environ, LOOPBACK), subscriber():
        sender = open_backend("sender", kind="cyclone")
        try:
            publisher = connect(sender)
            return {
                "encode": call_times(lambda: cdr.encode(message())),
                "publish": call_times(lambda: publisher.publish(message())),
            }
        finally:
            sender.close()


@contextmanager
def subscriber() -> Iterator[None]:
    """Run a process that subscribes, until the end of the block."""
    process = subprocess.Popen([sys.executable, "-m", __name__], stdin=subprocess.PIPE)
    try:
        yield
    finally:
        process.communicate()


def connect(sender: Backend) -> Publisher:
    """Return a publisher that has a subscription."""
    publisher = sender.publisher(TOPIC, JointState)
    end = time.monotonic() + DISCOVERY_SECONDS
    while not publisher.matched:
        if time.monotonic() > end:
            raise CatenaryError(f"no subscription matched within {DISCOVERY_SECONDS:.0f} s")
        sender.spin_once(0.01)
    return publisher


def receive() -> None:
    """Subscribe until stdin ends."""
    receiver = open_backend("receiver", kind="cyclone")
    receiver.subscription(TOPIC, JointState, STATE, lambda message: None)
    while not select.select([sys.stdin], [], [], 0)[0]:
        receiver.spin_once(0.05)
    receiver.close()


def call_times(call: Callable[[], object]) -> list[float]:
    """Return the time of each call [us]."""
    times = []
    for _ in range(CALLS):
        before = time.perf_counter_ns()
        call()
        times.append((time.perf_counter_ns() - before) / 1000)
    return times


if __name__ == "__main__":
    receive()

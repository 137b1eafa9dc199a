"""Processes next to the loop: recorder, dashboard, viewer, ROS 2, and load.

`python -m benchmarks.together.companions PART ...`:

    record SHARE FOLDER    records the share again and again, into one file
    ros2 SHARE             `catenary ros2`
    cpu                    computes without end
    memory                 writes to much memory without end
    network                sends datagrams to itself without end
"""

from __future__ import annotations

import os
import socket
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Never

from benchmarks.peers.dashboard_parts import dashboard, part
from catenary.realtime.child import Child, start_python

START_SECONDS = 60.0
RECORD_SECONDS = 15.0  # of this machine's time per recording
WAIT_SECONDS = 0.5
PAGE_PACKAGES = ("starlette", "uvicorn", "websockets", "httpx", "segno")
MEMORY_BYTES = 256 << 20
DATAGRAM = 1400  # [bytes]
LOADS = ("cpu", "cpu", "memory", "network")
LOW_PRIORITY = 5  # nice(1) of the load, so that helpers and Python still run
LOOPBACK = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@contextmanager
def companions(share: str, *, load: bool) -> Iterator[tuple[dict[str, Child], list[str]]]:
    """Start all processes that this machine permits.

    Yield them by name, and the reasons for those that are missing.
    """
    missing = []
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="catenary-soak-"))
        found = {"recorder": stack.enter_context(started("record", share, folder))}
        if absent := [name for name in PAGE_PACKAGES if find_spec(name) is None]:
            missing.append(f"dashboard: {', '.join(absent)} are not installed")
        else:
            cpus = ",".join(map(str, sorted(os.sched_getaffinity(0))))
            found["dashboard"], link = stack.enter_context(dashboard(share, cpus))
            found["viewer"], _ = stack.enter_context(part("view", cpus, link, "1"))
        if find_spec("cyclonedds") is None:
            missing.append("ROS 2: cyclonedds is not installed")
        else:
            found["ROS 2"] = stack.enter_context(started("ros2", share))
        for number, kind in enumerate(LOADS if load else ()):
            found[f"load {number} ({kind})"] = stack.enter_context(started(kind))
        yield found, missing


@contextmanager
def started(*arguments: str) -> Iterator[Child]:
    """Start a part, and wait for its first line."""
    with start_python(["-m", __name__, *arguments]) as child:
        if child.read_line(START_SECONDS) is None:
            raise RuntimeError(f"the part {arguments[0]!r} of the soak did not start")
        yield child


def record(share: str, folder: str) -> None:
    """Record again and again. Print the cycles and the lost ones of each recording."""
    import time

    from catenary.errors import ShareError
    from catenary.record import Recorder

    print("ready", flush=True)
    while True:
        try:
            with Recorder(share, Path(folder, "soak.mcap"), force=True) as recorder:
                recorder.run(seconds=RECORD_SECONDS)
        except ShareError:  # the loop has not started, or has ended
            time.sleep(WAIT_SECONDS)
            continue
        print(f"{recorder.cycles} {recorder.lost}", flush=True)


def ros2(share: str) -> None:
    from catenary.cli.main import main

    os.environ.update(LOOPBACK)
    main(["ros2", share, "--backend", "cyclone"])


def cpu() -> Never:
    begin()
    value = 1
    while True:
        value = value * 1103515245 + 12345 & 0x7FFFFFFF


def memory() -> Never:
    block = bytearray(MEMORY_BYTES)
    begin()
    while True:
        for start in range(0, MEMORY_BYTES, 1 << 20):
            block[start : start + (1 << 20)] = block[-1 - start : -1 - start - (1 << 20) : -1]


def network() -> Never:
    sender, receiver = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    receiver.bind(("127.0.0.1", 0))
    receiver.setblocking(False)
    address, data = receiver.getsockname(), bytes(DATAGRAM)
    begin()
    while True:
        for _ in range(32):
            sender.sendto(data, address)
        try:
            while receiver.recv(DATAGRAM):
                pass
        except BlockingIOError:  # all were received
            continue


def begin() -> None:
    os.nice(LOW_PRIORITY)
    print("ready", flush=True)


PARTS: dict[str, Callable[..., None]] = {
    "record": record,
    "ros2": ros2,
    "cpu": cpu,
    "memory": memory,
    "network": network,
}

if __name__ == "__main__":
    kind, *rest = sys.argv[1:]
    PARTS[kind](*rest)

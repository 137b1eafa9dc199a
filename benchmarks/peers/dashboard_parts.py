"""Processes of a dashboard benchmark: `python -m benchmarks.peers.dashboard_parts PART ...`.

    decoy CPUS SHARE AXES    a loop with its own segment and share
    serve CPUS SHARE         `catenary dashboard` on a free port
    view CPUS LINK N         N viewers that receive all positions, velocities and torques at 60 Hz

They have ordinary scheduling, and run on the processors CPUS. Each prints a line when it is ready.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from urllib.parse import urlsplit

import catenary as cat
from catenary.bench.segment import COUNTS_PER_TURN, make_segment
from catenary.realtime.child import Child, start_python

START_SECONDS = 60.0
RATE = 60.0  # frames per second
VIEWER, SIGNALS_MAX = "viewer: ", 256
QUANTITIES = ("position", "velocity", "torque")


@contextmanager
def part(*arguments: str) -> Iterator[tuple[Child, str]]:
    """Start a part, and yield it with its first line."""
    with start_python(["-m", __name__, *arguments]) as child:
        line = child.read_line(START_SECONDS)
        if line is None:
            raise RuntimeError(f"the part {arguments[0]!r} of the benchmark did not start")
        yield child, line


@contextmanager
def dashboard(share: str, cpus: str) -> Iterator[tuple[Child, str]]:
    """Start the dashboard, and yield it with the link of a viewer."""
    with part("serve", cpus, share) as (child, line):
        while not line.startswith(VIEWER):
            following = child.read_line(START_SECONDS)
            if following is None:
                raise RuntimeError("the dashboard printed no link for viewers")
            line = following
        yield child, line.removeprefix(VIEWER)


def run_decoy(share: str, axes: str) -> None:
    """Run a loop at 1 kHz until the process is ended."""
    with cat.MainDevice(make_segment(int(axes))) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=COUNTS_PER_TURN, velocity_limit=100.0)
        policy = cat.StopPolicy(lost_limit=100_000, late_limit=0.0, raise_faults=False)
        with (
            cat.Share(share) as sink,
            cat.Loop(arm, sink=sink, stop=policy, watchdog=0.0, priority=None) as loop,
        ):
            print("ready", flush=True)
            for _ in loop:
                pass


def run_dashboard(share: str) -> None:
    from catenary.cli.main import main

    main(["dashboard", share, "--port", "0"])


async def run_viewers(link: str, count: int) -> None:
    """Receive frames until the server ends."""
    cookie = await asyncio.to_thread(log_in, link)
    print("connected", flush=True)
    started = asyncio.Semaphore(0)
    viewers = [asyncio.create_task(view(link, cookie, started)) for _ in range(count)]
    for _ in range(count):
        await started.acquire()
    print("receiving", flush=True)
    await asyncio.gather(*viewers)


def log_in(link: str) -> str:
    """Exchange the token of a link for a cookie."""
    import httpx

    address = urlsplit(link)
    origin = f"{address.scheme}://{address.netloc}"
    token = address.fragment.removeprefix("token=")
    reply = httpx.post(f"{origin}/login", json={"token": token}, headers={"Origin": origin})
    reply.raise_for_status()
    return "; ".join(f"{name}={value}" for name, value in reply.cookies.items())


async def view(link: str, cookie: str, started: asyncio.Semaphore) -> None:
    """Subscribe to the signals of all axes, and discard the frames."""
    from websockets.asyncio.client import connect
    from websockets.exceptions import ConnectionClosed
    from websockets.typing import Origin

    address = urlsplit(link)
    async with connect(
        f"ws://{address.netloc}/ws",
        origin=Origin(f"{address.scheme}://{address.netloc}"),
        additional_headers={"Cookie": cookie},
        max_size=None,
    ) as socket:
        frames = 0
        with contextlib.suppress(ConnectionClosed):
            while True:
                data = await socket.recv()
                if isinstance(data, bytes):
                    frames += 1
                    if frames == 1:
                        started.release()
                elif (message := json.loads(data))["op"] == "hello":
                    await socket.send(json.dumps(subscription(len(message["layout"]["axes"]))))


def subscription(axes: int) -> dict[str, object]:
    signals = [f"{name}[{axis}]" for axis in range(axes) for name in QUANTITIES]
    return {
        "op": "subscribe",
        "id": 1,
        "signals": signals[:SIGNALS_MAX],
        "full": False,
        "rate": RATE,
    }


def main(arguments: Sequence[str]) -> None:
    kind, cpus, *others = arguments
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.sched_setaffinity(0, map(int, cpus.split(",")))
    if kind == "decoy":
        run_decoy(*others)
    elif kind == "serve":
        run_dashboard(*others)
    else:
        asyncio.run(run_viewers(others[0], int(others[1])))


if __name__ == "__main__":
    main(sys.argv[1:])

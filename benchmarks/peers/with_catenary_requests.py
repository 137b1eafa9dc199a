"""Catenary with a share and one client: at the limit of the remote service, or idle.

The client is a process that calls three methods in turn, at 200 requests per second. The bystander
wakes as often, and does the work of a client without sending anything.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import os
import sys
import time
from collections.abc import Iterator, Sequence
from typing import Any

import catenary as cat
from benchmarks.peers.with_catenary_share import START_SECONDS
from catenary.bench.job import Job, Round
from catenary.bench.python_loop import body_of, measure, opened
from catenary.errors import CatenaryError, ShareError
from catenary.realtime.child import Child, start_python
from catenary.remote.connection import encode_request

RATE = 200.0  # requests per second
PENDING = 8  # the limit of one client
METHODS: Sequence[tuple[str, dict[str, Any]]] = (
    ("devices", {}),
    ("timing", {}),
    ("sdo_read", {"position": 2, "index": 0x1018, "subindex": 1}),
)


def run(job: Job) -> Round:
    name = f"bench-remote-{os.getpid()}"
    with (
        client(name, job.peer.endswith("-requests")) as child,
        cat.Share(name) as share,
        opened(job, share) as (loop, arm),
    ):
        body = body_of(arm, job)
        deadline = time.monotonic() + START_SECONDS
        for cycle in loop:  # the client connects while the loop runs
            body(cycle.time)
            if child.read_line(0.0) is not None:
                break
            if time.monotonic() > deadline:
                raise RuntimeError(f"the client did not start within {START_SECONDS:.0f} s")
        return measure(loop, arm, job, [], body)


@contextlib.contextmanager
def client(name: str, sending: bool) -> Iterator[Child]:
    """Run the client with ordinary scheduling, not on the processor of the loop."""
    here = os.sched_getaffinity(0)
    elsewhere = os.sched_getaffinity(os.getppid()) - here or here  # CPUs of the benchmark's process
    arguments = ["-m", __name__, name, ",".join(map(str, elsewhere)), str(int(sending))]
    with start_python(arguments) as child:
        if child.read_line(START_SECONDS) is None:
            raise RuntimeError("the client did not start")
        yield child


def main(arguments: Sequence[str]) -> None:
    """Send requests until the loop ends."""
    name, cpus, sending = arguments
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.sched_setaffinity(0, map(int, cpus.split(",")))
    print("ready", flush=True)
    with contextlib.suppress(CatenaryError, ExceptionGroup):
        asyncio.run(send_all(name, sending == "1"))


async def send_all(name: str, sending: bool) -> None:
    """Send requests at RATE, with at most PENDING at a time."""
    places = asyncio.Semaphore(PENDING)
    async with await connected(name) as program:
        await program.call("hello")
        os.write(sys.stdout.fileno(), b"connected\n")
        due = time.monotonic()
        async with asyncio.TaskGroup() as group:
            for serial in itertools.count():
                method, params = METHODS[serial % len(METHODS)]
                await places.acquire()
                if sending:
                    asked = group.create_task(program.call(method, **params))
                    asked.add_done_callback(lambda _: places.release())
                else:
                    encode_request(serial, method, 1.0, params)
                    places.release()
                due = max(due + 1 / RATE, time.monotonic())
                await asyncio.sleep(due - time.monotonic())


async def connected(name: str) -> cat.remote.AsyncClient:
    """Connect to the share as soon as it exists."""
    deadline = time.monotonic() + START_SECONDS
    while True:
        try:
            return await cat.connect_async(name)
        except ShareError:
            if time.monotonic() > deadline:
                raise
            await asyncio.sleep(0.01)


if __name__ == "__main__":
    main(sys.argv[1:])

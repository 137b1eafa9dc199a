"""Catenary with a share: without readers, with 16 readers, or with 16 bystanders.

A reader is a process that reads a hundred times a second. A bystander does the same work with
private memory. It shows how much a busy neighbour slows a processor without reading.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

import catenary as cat
from catenary.bench.job import Job, Round
from catenary.bench.python_loop import body_of, measure, opened
from catenary.errors import ShareError
from catenary.realtime.child import Child, start_python
from catenary.realtime.system.libc import signal_on_parents_death

READERS = 16
PAUSE = 0.010  # [s]
START_SECONDS = 60.0
WITH_READERS = ("-readers", "-bystanders")


def run(job: Job) -> Round:
    name = f"bench-{os.getpid()}"
    if not job.peer.endswith(WITH_READERS):
        with cat.Share(name) as share, opened(job, share) as (loop, arm):
            return measure(loop, arm, job, [])
    with (
        readers(name, job.peer.endswith("-readers")) as child,
        cat.Share(name) as share,
        opened(job, share) as (loop, arm),
    ):
        body = body_of(arm, job)
        attend(loop, child, body)
        return measure(loop, arm, job, [], body)


def attend(loop: cat.Loop, child: Child, body: Callable[[float], None]) -> None:
    """Run cycles until every reader has read, so that the loop does not stand still."""
    missing = READERS
    deadline = time.monotonic() + START_SECONDS
    for cycle in loop:
        body(cycle.time)
        if child.read_line(0.0) is not None:
            missing -= 1
        if missing == 0:
            return
        if time.monotonic() > deadline:
            raise RuntimeError(f"{missing} readers did not start within {START_SECONDS:.0f} s")


@contextlib.contextmanager
def readers(name: str, reading: bool) -> Iterator[Child]:
    """Run the readers, which wait for the share of the loop.

    They have ordinary scheduling and do not run on the processor of the loop.
    """
    here = os.sched_getaffinity(0)
    elsewhere = os.sched_getaffinity(os.getppid()) - here or here  # CPUs of the benchmark's process
    arguments = ["-m", __name__, name, ",".join(map(str, elsewhere)), str(int(reading))]
    with start_python(arguments) as child:
        if child.read_line(START_SECONDS) is None:
            raise RuntimeError("the readers did not start")
        yield child


def main(arguments: Sequence[str]) -> None:
    """Run all readers, as forks of one interpreter. They end with the loop."""
    name, cpus, reading = arguments
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.sched_setaffinity(0, map(int, cpus.split(",")))
    print("ready", flush=True)
    for _ in range(READERS - 1):
        if os.fork() == 0:
            signal_on_parents_death(signal.SIGKILL)
            break
    with attached(name) as arm:
        arm.wait(timeout=START_SECONDS)
        arm.read()
        os.write(sys.stdout.fileno(), b"reading\n")
        own = bytes(arm.dtype.itemsize)
        while arm.alive if reading == "0" else arm.wait(timeout=START_SECONDS):
            _ = np.frombuffer(bytearray(own), arm.dtype)[0] if reading == "0" else arm.read()
            time.sleep(PAUSE)


def attached(name: str) -> cat.share.Reader:
    """Attach to the share as soon as it exists."""
    deadline = time.monotonic() + START_SECONDS
    while True:
        try:
            return cat.attach(name)
        except ShareError:
            if time.monotonic() > deadline:
                raise
            time.sleep(PAUSE)


if __name__ == "__main__":
    main(sys.argv[1:])

"""Catenary with a share: nobody reads it; 16 processes do, a hundred times a second each; or they
do as much with memory of their own: a busy neighbour of a processor slows it, share or not."""

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
    """Cycles until every reader has read: a loop must not stand still for them."""
    missing = READERS
    deadline = time.monotonic() + START_SECONDS
    for cycle in loop:
        body(cycle.time)
        if child.read_line(0.0) is not None:
            missing -= 1
        if missing == 0:
            return
        if time.monotonic() > deadline:
            raise RuntimeError(f"{missing} readers did not come")


@contextlib.contextmanager
def readers(name: str, reading: bool) -> Iterator[Child]:
    """They look for the loop before it is there. They run anywhere but where the loop was put, with
    ordinary scheduling."""
    here = os.sched_getaffinity(0)
    elsewhere = os.sched_getaffinity(os.getppid()) - here or here  # of the benchmark's own process
    arguments = ["-m", __name__, name, ",".join(map(str, elsewhere)), str(int(reading))]
    with start_python(arguments) as child:
        if child.read_line(START_SECONDS) is None:
            raise RuntimeError("the readers did not start")
        yield child


def main(arguments: Sequence[str]) -> None:
    """All readers: one process each, of one start of the interpreter. They end with the loop."""
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
    """As soon as the loop is there."""
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

"""Catenary with a share and `catenary dashboard` with 10 viewers.

The viewers see this loop (`-viewers`), or another loop of the same size (`-others`). Both variants
run the same processes, so that the load of the processors is equal.
"""

from __future__ import annotations

import os
import time
from contextlib import ExitStack

import catenary as cat
from benchmarks.peers.dashboard_parts import START_SECONDS, dashboard, part
from catenary.bench.job import Job, Round
from catenary.bench.python_loop import body_of, measure, opened

VIEWERS = 10


def run(job: Job) -> Round:
    name, other = f"bench-{os.getpid()}", f"bench-{os.getpid()}-other"
    here = os.sched_getaffinity(0)
    cpus = ",".join(map(str, os.sched_getaffinity(os.getppid()) - here or here))
    with ExitStack() as stack:
        stack.enter_context(part("decoy", cpus, other, str(len(job.drives))))
        share = name if job.peer.endswith("-viewers") else other
        _, link = stack.enter_context(dashboard(share, cpus))
        viewers, _ = stack.enter_context(part("view", cpus, link, str(VIEWERS)))
        sink = stack.enter_context(cat.Share(name))
        loop, arm = stack.enter_context(opened(job, sink))
        body, deadline = body_of(arm, job), time.monotonic() + START_SECONDS
        for cycle in loop:  # until each viewer has received a frame
            body(cycle.time)
            if viewers.read_line(0.0) is not None:
                return measure(loop, arm, job, [], body)
            if time.monotonic() > deadline:
                raise RuntimeError(f"no frames within {START_SECONDS:g} s")
    raise RuntimeError("the loop ended")

"""Loop of one network with a law, in a separate process: `python -m benchmarks.network_law JOB`.

The published humanoid has one such process for each network. The process prints "here" after its
imports and opens the loop at SIGUSR1. It prints "ready" when the law runs, measures from the next
SIGUSR1 on, and prints its results. A running loop therefore cannot delay one that is starting.
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Sequence
from importlib import import_module

import msgspec

import catenary as cat
from benchmarks.networks import NetworkRound, phases_of
from catenary.bench.job import Job
from catenary.bench.law_loop import sine
from catenary.bench.python_loop import opened
from catenary.errors import CatenaryError

GO = signal.SIGUSR1
GO_TIMEOUT = 120.0  # [s] for the other processes to be ready
POLL_CYCLES = 500  # cycles between two readings of the counters
NEVER = 1e9  # [s]
BUDGET_SHARE = 0.1  # of the period: the frames of two networks on one processor need the rest


def run_law(job: Job) -> NetworkRound:
    import_module("numba")  # opening the loop compiles the law
    wait_to_go("here")
    with opened(job, laws=[sine]) as (loop, arm):
        home = arm.actual.position.copy()
        parameters = [job.amplitude, job.stiffness, job.damping, NEVER]
        loop.start(
            sine, memory=home, parameters=parameters, budget=BUDGET_SHARE * job.period_ns * 1e-9
        )
        wait_to_go("ready")
        return count(loop, job)


def wait_to_go(state: str) -> None:
    print(state, flush=True)
    if signal.sigtimedwait({GO}, GO_TIMEOUT) is None:
        raise CatenaryError(f"no start signal (SIGUSR1) within {GO_TIMEOUT:.0f} s")


def count(loop: cat.Loop, job: Job) -> NetworkRound:
    """Count the losses of a job. If the loop stands still, `next` raises its error."""
    before = loop.timing.counters
    first = now = before["cycles"]
    while (left := first + job.cycles - now) > 0:
        time.sleep(max(min(left, POLL_CYCLES), 1) * job.period_ns * 1e-9)
        seen, now = now, loop.timing.counters["cycles"]
        if now == seen:
            next(loop)
    after = loop.timing.counters
    return NetworkRound(
        lost=after["lost"] - before["lost"],
        late=after["late"] - before["late"],
        phases_ns=phases_of(loop, after["cycles"] - first),
    )


def main(arguments: Sequence[str]) -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, {GO})  # the parent process blocked it, too
    job = msgspec.json.decode(arguments[0], type=Job)
    print(msgspec.json.encode(run_law(job)).decode(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])

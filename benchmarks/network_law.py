"""Loop with a law on each of its networks, in a separate process.

    python -m benchmarks.network_law JOBS [send:NAME | await:NAME]

The published humanoid has one such process for each network. The second starts its cycles with
those of the first: `send:` and `await:` name that trigger. The process prints "here" after its
imports and opens the loop at SIGUSR1. It prints "ready" when the laws run, measures from the next
SIGUSR1 on, and prints its results. A running loop therefore cannot delay one that is starting.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from importlib import import_module

import msgspec

import catenary as cat
from benchmarks.networks import NetworkRound, phases_of
from catenary.bench.job import Job
from catenary.bench.law_loop import sine
from catenary.bench.python_loop import LATE_LIMIT, LOST_LIMIT
from catenary.errors import CatenaryError
from catenary.loop import Network
from catenary.share import TriggerReceiver, TriggerSender

GO = signal.SIGUSR1
GO_TIMEOUT = 120.0  # [s] for the other processes to be ready
POLL_CYCLES = 500  # cycles between two readings of the counters
NEVER = 1e9  # [s]
BUDGET_SHARE = 0.1  # of the period: the frames of two networks on one processor need the rest


def run_laws(
    jobs: Sequence[Job], trigger: TriggerSender | TriggerReceiver | None
) -> list[NetworkRound]:
    import_module("numba")  # opening the loop compiles the law
    wait_to_go("here")
    with opened(jobs, trigger) as (loop, bodies):
        for network, (body, job) in enumerate(zip(bodies, jobs, strict=True)):
            loop.start(
                sine,
                memory=body.actual.position.copy(),
                parameters=[job.amplitude, job.stiffness, job.damping, NEVER],
                budget=BUDGET_SHARE * job.period_ns * 1e-9,
                network=network,
            )
        wait_to_go("ready")
        return count(loop, jobs[0])


@contextlib.contextmanager
def opened(
    jobs: Sequence[Job], trigger: TriggerSender | TriggerReceiver | None
) -> Iterator[tuple[cat.Loop, list[cat.Drives]]]:
    """Open a loop over the networks of all jobs."""
    first = jobs[0]
    with contextlib.ExitStack() as stack:
        mains = [stack.enter_context(cat.MainDevice(*job.interfaces)) for job in jobs]
        bodies = [
            cat.Drives(
                main.scan().drives, counts_per_turn=job.counts_per_turn, velocity_limit=100.0
            )
            for main, job in zip(mains, jobs, strict=True)
        ]
        loop = cat.Loop(
            *bodies,
            period=first.period_ns * 1e-9,
            cpu=first.cpu,
            priority=first.priority,
            stop=cat.StopPolicy(lost_limit=LOST_LIMIT, late_limit=LATE_LIMIT),
            scheduling=cat.Scheduling(busy_wait=first.busy_wait),
            log=first.log,
            laws=[sine],
            trigger=trigger,
        )
        yield stack.enter_context(loop), bodies


def wait_to_go(state: str) -> None:
    print(state, flush=True)
    if signal.sigtimedwait({GO}, GO_TIMEOUT) is None:
        raise CatenaryError(f"no start signal (SIGUSR1) within {GO_TIMEOUT:.0f} s")


def count(loop: cat.Loop, job: Job) -> list[NetworkRound]:
    """Count the losses of a job. If a loop stands still, `next` raises its error."""
    before = [network.timing.counters for network in loop.networks]
    first = now = before[0]["cycles"]
    while (left := first + job.cycles - now) > 0:
        time.sleep(max(min(left, POLL_CYCLES), 1) * job.period_ns * 1e-9)
        seen, now = now, loop.timing.counters["cycles"]
        if now == seen:
            next(loop)
    return [as_round(*each) for each in zip(loop.networks, before, strict=True)]


def as_round(network: Network, before: dict[str, int]) -> NetworkRound:
    after = network.timing.counters
    return NetworkRound(
        lost=after["lost"] - before["lost"],
        late=after["late"] - before["late"],
        phases_ns=phases_of(network, after["cycles"] - before["cycles"]),
        missed_triggers=after["missed_triggers"] - before["missed_triggers"],
    )


def trigger_of(arguments: Sequence[str]) -> TriggerSender | TriggerReceiver | None:
    """Return the trigger "send:NAME" or "await:NAME" of the command line; None without one."""
    if not arguments:
        return None
    role, _, name = arguments[0].partition(":")
    return TriggerSender(name) if role == "send" else TriggerReceiver(name)


def main(arguments: Sequence[str]) -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, {GO})  # the parent process blocked it, too
    jobs = msgspec.json.decode(arguments[0], type=list[Job])
    print(msgspec.json.encode(run_laws(jobs, trigger_of(arguments[1:]))).decode(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])

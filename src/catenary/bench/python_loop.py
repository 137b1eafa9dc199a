"""Peers `catenary-inline` and `catenary-threaded`: ordinary Catenary loops in Python."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Literal

import numpy as np

import catenary as cat
from catenary.bench.job import PHASES, Body, Job, Nanoseconds, Round
from catenary.log import Log
from catenary.loop.laws.law import Law

# Count lost and late cycles and continue, like the other peers. A loop stops the drives by default.
LOST_LIMIT = 1000
LATE_LIMIT = 10.0  # [s]
MODE = {Body.SINE: "csp", Body.PD: "cst"}


def run(job: Job) -> Round:
    with opened(job) as (loop, arm):
        return measure(loop, arm, job, [])


def order(job: Job) -> Literal["inline", "threaded"]:
    return "inline" if "-inline" in job.peer else "threaded"


@contextlib.contextmanager
def opened(
    job: Job, sink: cat.Share | None = None, laws: Sequence[Law] = ()
) -> Iterator[tuple[cat.Loop, cat.Drives]]:
    """Open the loop of a round and its drives."""
    with cat.MainDevice(*job.interfaces) as main:
        subs = main.scan()
        arm = cat.Drives(
            [subs[position] for position in job.drives],
            mode=MODE[job.body],
            counts_per_turn=job.counts_per_turn,
            velocity_limit=100.0,
        )
        with cat.Loop(
            arm,
            period=job.period_ns * 1e-9,
            execution=order(job),
            cpu=job.cpu,
            priority=job.priority,
            stop=cat.StopPolicy(lost_limit=LOST_LIMIT, late_limit=LATE_LIMIT),
            scheduling=cat.Scheduling(busy_wait=job.busy_wait),
            log=job.log,
            laws=laws,
            sink=sink,
        ) as loop:
            yield loop, arm


def body_of(arm: cat.Drives, job: Job) -> Callable[[float], None]:
    """Return the body of a cycle. The motion starts at the current positions."""
    return _sine(arm, job) if job.body is Body.SINE else _pd(arm, job)


def measure(
    loop: cat.Loop,
    arm: cat.Drives,
    job: Job,
    answers: Sequence[int],
    body: Callable[[float], None] | None = None,
) -> Round:
    """Run the loop and return its figures.

    Args:
        loop: The open loop.
        arm: The drives of the loop.
        job: The parameters of the round.
        answers: Counts of answers to SDO requests, which increase during the run.
        body: Function that each cycle calls with its time [s]; None for the body of the job.
    """
    body = body or body_of(arm, job)
    before, cpu, first, answered = loop.timing.counters, 0.0, 0, 0
    last_unmeasured, end = job.warm_up - 1, job.warm_up + job.cycles
    for number, cycle in enumerate(loop):
        body(cycle.time)
        if number == last_unmeasured:
            answered, before, first = sum(answers), loop.timing.counters, cycle.number
            cpu = time.process_time_ns()
        elif number == end:
            cpu = (time.process_time_ns() - cpu) / (cycle.number - first)
            break
    after = loop.timing.counters
    return Round(
        samples_of(loop.log[-job.cycles - 1 : -1]),  # the last cycle is incomplete
        lost=after["lost"] - before["lost"],
        cpu_per_cycle_ns=cpu,
        uncommitted=after["uncommitted"] - before["uncommitted"],
        answers=sum(answers) - answered,
    )


def samples_of(log: Log) -> Nanoseconds:
    """Return the phases of the logged cycles, shape (cycles, phases) [ns]."""
    return np.stack([log[f"{phase}_ns"] for phase in PHASES], axis=1).astype(np.int64)


def _sine(arm: cat.Drives, job: Job) -> Callable[[float], None]:
    home = arm.actual.position.copy()
    target, amplitude = arm.target.position, job.amplitude

    def body(t: float) -> None:
        target[:] = home + amplitude * math.sin(math.pi * t)

    return body


def _pd(arm: cat.Drives, job: Job) -> Callable[[float], None]:
    home = arm.actual.position.copy()
    position, velocity, torque = arm.actual.position, arm.actual.velocity, arm.target.torque
    amplitude, stiffness, damping = job.amplitude, job.stiffness, job.damping

    def body(t: float) -> None:
        reference = home + amplitude * math.sin(math.pi * t)
        torque[:] = stiffness * (reference - position) - damping * velocity

    return body

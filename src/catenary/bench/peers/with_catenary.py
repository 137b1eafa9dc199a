"""Catenary as its users write it, inline and threaded.

The peers with `-sdo` also read objects of all devices from other threads, without a pause.
"""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Literal

import numpy as np

import catenary as cat
from catenary.bench.job import PHASES, Body, Job, Nanoseconds, Round
from catenary.log import Log
from catenary.loop.laws.law import Law

STORM = "-sdo"
IDENTITY, SERIAL = 0x1018, 4  # the object that the storm reads
# Like the peers, a loop counts lost and late cycles and continues; by default it stops the drives.
LOST_LIMIT = 1000
LATE_LIMIT = 10.0  # [s]
MODE = {Body.SINE: "csp", Body.PD: "cst"}


def run(job: Job) -> Round:
    with opened(job) as (loop, arm):
        if not job.peer.endswith(STORM):
            return measure(loop, arm, job, [])
        with storm(arm.subs) as answers:
            return measure(loop, arm, job, answers)


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


@contextlib.contextmanager
def storm(subs: Sequence[cat.SubDevice]) -> Iterator[list[int]]:
    """Run one thread per device that reads one object repeatedly; yield the number of answers of
    each. The threads run on the other processors, as in an application with a reserved one."""
    answers = [0] * len(subs)
    stop = threading.Event()
    here = os.sched_getaffinity(0)
    elsewhere = os.sched_getaffinity(os.getppid()) - here or here  # of the benchmark's own process

    def ask(rank: int) -> None:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, elsewhere)
        while not stop.is_set():
            try:
                subs[rank].sdo.read(IDENTITY, SERIAL, type=cat.types.UDINT)
                answers[rank] += 1
            except cat.CatenaryError:
                if not stop.is_set():  # after the last cycle nothing is sent
                    raise

    threads = [threading.Thread(target=ask, args=(rank,)) for rank in range(len(subs))]
    for thread in threads:
        thread.start()
    try:
        yield answers
    finally:
        stop.set()
        for thread in threads:
            thread.join()


def body_of(arm: cat.Drives, job: Job) -> Callable[[float], None]:
    """Return the body of a cycle. The motion starts at the present positions."""
    return _sine(arm, job) if job.body is Body.SINE else _pd(arm, job)


def measure(
    loop: cat.Loop,
    arm: cat.Drives,
    job: Job,
    answers: Sequence[int],
    body: Callable[[float], None] | None = None,
) -> Round:
    """Iterate the loop and return its figures. `body`: one that is running already."""
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

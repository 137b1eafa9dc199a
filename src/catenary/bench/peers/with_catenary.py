"""Catenary itself, as its users write it, inline and threaded; also while other threads of the
program read objects of all devices, all the time."""

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
from catenary.bench.job import PHASES, Body, Job, Round
from catenary.loop.laws.law import Law

STORM = "-sdo"
IDENTITY, SERIAL = 0x1018, 4  # what the storm asks for
# Like the peers, it counts lost and late cycles and goes on; by default it would stop the drives.
LOST_LIMIT = 1000
LATE_LIMIT = 10.0  # [s]: a benchmark must not stop the axes
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
    """The loop of a round."""
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
            run=order(job),
            cpu=job.cpu,
            priority=job.priority,
            lost_limit=LOST_LIMIT,
            late_limit=LATE_LIMIT,
            busy_wait=job.busy_wait,
            log=job.log,
            laws=laws,
            sink=sink,
        ) as loop:
            yield loop, arm


@contextlib.contextmanager
def storm(subs: Sequence[cat.SubDevice]) -> Iterator[list[int]]:
    """A thread for every device that reads one object again and again; how often each got it. They
    run anywhere but where the loop was put: an application gives that processor away."""
    answers = [0] * len(subs)
    stop = threading.Event()
    here = os.sched_getaffinity(0)
    elsewhere = os.sched_getaffinity(os.getppid()) - here or here  # of who leads the benchmark

    def ask(rank: int) -> None:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, elsewhere)
        while not stop.is_set():
            try:
                subs[rank].sdo.read(IDENTITY, SERIAL, type=cat.types.UDINT)
                answers[rank] += 1
            except cat.CatenaryError:
                if not stop.is_set():  # behind the last cycle nobody sends any more
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
    """What is computed in a cycle, from where the axes are now."""
    return _sine(arm, job) if job.body is Body.SINE else _pd(arm, job)


def measure(
    loop: cat.Loop,
    arm: cat.Drives,
    job: Job,
    answers: Sequence[int],
    body: Callable[[float], None] | None = None,
) -> Round:
    """`body`: one that runs already."""
    body = body or body_of(arm, job)
    before, cpu, answered = loop.timing.counters, 0, 0
    last_unmeasured, end = job.warm_up - 1, job.warm_up + job.cycles
    for number, cycle in enumerate(loop):
        body(cycle.time)
        if number == last_unmeasured:
            before, cpu = loop.timing.counters, time.process_time_ns()
            answered = sum(answers)
        elif number == end:
            break
    cpu = time.process_time_ns() - cpu
    after = loop.timing.counters
    log = loop.log[-job.cycles - 1 : -1]  # the last one was left unfinished
    samples = np.stack([log[f"{phase}_ns"] for phase in PHASES], axis=1).astype(np.int64)
    return Round(
        samples,
        lost=after["lost"] - before["lost"],
        cpu_ns=cpu,
        late=after["uncommitted"] - before["uncommitted"],
        answers=sum(answers) - answered,
    )


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

"""Peer `catenary-law`: the same loop bodies as compiled laws in the native thread."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

import catenary as cat
from catenary.bench.job import Body, Job, Round
from catenary.bench.python_loop import opened, samples_of
from catenary.loop import LawRun

AMPLITUDE, STIFFNESS, DAMPING, END = range(4)  # indices of the parameters
CYCLE_OK = 1  # bit in the flags of a record
NEVER = 1e9  # [s]
CHECK_CYCLES = 500  # cycles between two checks that the law is still running


@cat.law
def sine(actual: Any, target: Any, memory: Any, time: Any, parameters: Any) -> bool:
    offset = parameters[AMPLITUDE] * math.sin(math.pi * time)
    for i in range(actual.n):
        target.position[i] = memory[i] + offset
    return bool(time >= parameters[END])


@cat.law
def pd(actual: Any, target: Any, memory: Any, time: Any, parameters: Any) -> bool:
    offset = parameters[AMPLITUDE] * math.sin(math.pi * time)
    for i in range(actual.n):
        error = memory[i] + offset - actual.position[i]
        target.torque[i] = parameters[STIFFNESS] * error - parameters[DAMPING] * actual.velocity[i]
    return bool(time >= parameters[END])


def run(job: Job) -> Round:
    law = sine if job.body is Body.SINE else pd
    with opened(job, laws=[law]) as (loop, arm):
        return _measure(loop, law, arm.actual.position.copy(), job)


def _measure(loop: cat.Loop, law: Any, home: Any, job: Job) -> Round:
    running = loop.start(
        law,
        memory=home,
        parameters=[job.amplitude, job.stiffness, job.damping, NEVER],
        budget=0,  # no limit, because the other peers also continue after a long step
    )
    _sleep(loop, running, job.warm_up, job)
    first, cpu = running.steps, time.process_time_ns()
    _sleep(loop, running, first + job.cycles, job)
    cpu, cycles = time.process_time_ns() - cpu, running.steps - first
    log = loop.log
    log = log[log["process_ns"] >= 0][-job.cycles :]  # omit the cycle in progress
    lost = int(np.count_nonzero(log["flags"] & CYCLE_OK == 0))
    return Round(samples_of(log), lost=lost, cpu_per_cycle_ns=cpu / cycles)


def _sleep(loop: cat.Loop, running: LawRun, steps: int, job: Job) -> None:
    """Sleep until the law has made `steps` steps. The law runs without this thread."""
    while (left := steps - running.steps) > 0:
        before = running.steps
        time.sleep(min(left, CHECK_CYCLES) * job.period_ns * 1e-9)
        if running.steps == before:
            next(loop)  # raises the error that stopped the law

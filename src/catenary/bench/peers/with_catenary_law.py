"""Catenary's compiled laws: the same bodies in the native thread."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

import catenary as cat
from catenary.bench.job import PHASES, Body, Job, Round
from catenary.bench.peers.with_catenary import opened

AMPLITUDE, STIFFNESS, DAMPING, END = range(4)  # of the parameters
CYCLE_OK = 1  # bit of a record's flags


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
    cycles = job.warm_up + job.cycles
    end = (cycles - 1) * job.period_ns * 1e-9
    cpu = time.process_time_ns()
    loop.run(
        law,
        memory=home,
        parameters=[job.amplitude, job.stiffness, job.damping, end],
        budget=0,  # like the peers, it goes on
    )
    cpu = time.process_time_ns() - cpu
    log = loop.log
    log = log[log["process_ns"] >= 0][-job.cycles :]
    samples = np.stack([log[f"{phase}_ns"] for phase in PHASES], axis=1).astype(np.int64)
    lost = int(np.count_nonzero(log["flags"] & CYCLE_OK == 0))
    return Round(samples, lost=lost, cpu_ns=cpu * job.cycles // cycles)

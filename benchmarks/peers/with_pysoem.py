"""PySOEM as its users write it.

`config_init`, `config_map`, bytes packed by `struct` into `slave.output`, `send_processdata` and
`receive_processdata`. A cycle is the same for all peers: wait, receive, process, send.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pysoem

from catenary.bench.job import Body, Job, Round

# controlword, mode of operation, target velocity, target position, target torque
OUTPUTS = struct.Struct("<Hbiih")
# statusword, mode display, actual velocity, actual position, actual torque
INPUTS = struct.Struct("<Hbiih")
RECEIVE_TIMEOUT_US = 2000
MODE = {Body.SINE: 8, Body.PD: 10}
STEP_TO_ENABLED = {0x21: 0x07, 0x23: 0x0F, 0x27: 0x0F}


def run(job: Job) -> Round:
    master = pysoem.Master()
    master.open(job.interface)
    try:
        if master.config_init() <= 0:
            raise RuntimeError("PySOEM found no device")
        master.config_map()
        drives = [master.slaves[position] for position in job.drives]
        _to_operational(master, job)
        homes = _enable(master, drives, job)
        return _measure(master, drives, homes, job)
    finally:
        master.state = pysoem.INIT_STATE
        master.write_state()
        master.close()


def _to_operational(master: Any, job: Job) -> None:
    if master.state_check(pysoem.SAFEOP_STATE, 2_000_000) != pysoem.SAFEOP_STATE:
        raise RuntimeError("PySOEM did not reach SAFE-OP")
    master.state = pysoem.OP_STATE
    master.write_state()
    for _ in range(2000):
        _turn(master, job)
        if master.state_check(pysoem.OP_STATE, 1000) == pysoem.OP_STATE:
            return
    raise RuntimeError("PySOEM did not reach OP")


def _enable(master: Any, drives: list[Any], job: Job) -> list[int]:
    """Enable the drives, holding their positions. Return these positions [counts]."""
    for _ in range(5000):
        _turn(master, job)
        enabled, homes = 0, []
        for drive in drives:
            status, _, _, position, _ = INPUTS.unpack(drive.input)
            state = status & 0x6F
            control = 0x80 if status & 0x4F == 0x08 else STEP_TO_ENABLED.get(state, 0x06)
            drive.output = OUTPUTS.pack(control, MODE[job.body], 0, position, 0)
            enabled += state == 0x27
            homes.append(position)
        if enabled == len(drives):
            return homes
    raise RuntimeError("PySOEM could not enable the drives")


def _turn(master: Any, job: Job) -> None:
    master.send_processdata()
    master.receive_processdata(RECEIVE_TIMEOUT_US)
    time.sleep(job.period_ns * 1e-9)


def _measure(master: Any, drives: list[Any], homes: list[int], job: Job) -> Round:
    body = _sine(drives, homes, job) if job.body is Body.SINE else _pd(drives, homes, job)
    expected = master.expected_wkc
    now = time.monotonic_ns
    stamps: list[tuple[int, int, int, int, int, int, int]] = []
    lost = cpu = 0
    end = job.warm_up + job.cycles
    master.send_processdata()
    start = deadline = sent = now()
    for number in range(end + 1):
        deadline += job.period_ns
        waiting = now()
        if number == job.warm_up:
            cpu = time.process_time_ns()
        elif number == end:
            cpu = time.process_time_ns() - cpu
        if deadline > waiting:
            time.sleep((deadline - waiting) * 1e-9)
        woke, sent_before = now(), sent
        counter = master.receive_processdata(RECEIVE_TIMEOUT_US)
        received = now()
        body((deadline - start) * 1e-9)
        processed = now()
        master.send_processdata()
        sent = now()
        if number >= job.warm_up:
            stamps.append((waiting, deadline, woke, sent_before, received, processed, sent))
            lost += counter != expected
    return Round(_phases(np.array(stamps, np.int64)), lost, cpu / job.cycles)


def _phases(stamps: np.ndarray) -> np.ndarray:
    """Convert times to durations. The last cycle only ends the previous one."""
    waiting, deadline, woke, sent_before, received, processed, sent = stamps.T
    durations = [
        np.diff(woke, prepend=woke[0])[:-1],
        (woke - deadline)[:-1],
        (received - woke)[:-1],
        (processed - received)[:-1],
        (sent - processed)[:-1],
        waiting[1:] - sent[:-1],
        (sent - deadline)[:-1],
        (received - sent_before)[:-1],
    ]
    return np.stack(durations, axis=1)


def _sine(drives: list[Any], homes: list[int], job: Job) -> Callable[[float], None]:
    counts = job.amplitude * job.counts_per_rad

    def body(t: float) -> None:
        offset = int(counts * math.sin(math.pi * t))
        for drive, home in zip(drives, homes, strict=True):
            drive.output = OUTPUTS.pack(0x0F, 8, 0, home + offset, 0)

    return body


def _pd(drives: list[Any], homes: list[int], job: Job) -> Callable[[float], None]:
    scale = 1.0 / job.counts_per_rad
    amplitude, stiffness, damping = job.amplitude, job.stiffness, job.damping
    counts_per_torque = job.counts_per_torque

    def body(t: float) -> None:
        reference = amplitude * math.sin(math.pi * t)
        for drive, home in zip(drives, homes, strict=True):
            _, _, velocity, position, _ = INPUTS.unpack(drive.input)
            torque = stiffness * (reference - (position - home) * scale)
            torque -= damping * velocity * scale
            counts = int(torque * counts_per_torque)
            drive.output = OUTPUTS.pack(0x0F, 10, 0, 0, counts)

    return body

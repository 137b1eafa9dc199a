"""The C peers.

Catenary brings the segment to PRE-OP, sets SyncManagers and FMMUs, and closes its link. The C
program receives the frame of the cycle and the offsets of the words in it. It requests SAFE-OP and
OP itself, since valid outputs must be sent during the transition. It runs the same cycle as the
other peers.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np

import catenary as cat
from benchmarks.compiler import compile_peer
from catenary.bench.job import PHASES, Body, Job, Round
from catenary.errors import CatenaryError
from catenary.plan.cycle import AxisPlan, CyclePlan, DatagramKind, FramePlan, Number
from catenary.wire.al import AlState
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import encode_frame
from catenary.wire.register import AL_CONTROL

BODY = {Body.SINE: 0, Body.PD: 1}
MODE = {Body.SINE: "csp", Body.PD: "cst"}
WAY_TO_OPERATIONAL = (AlState.PRE_OP, AlState.SAFE_OP, AlState.OP)
DATAGRAM_HEADER = 10
BUSY = "c-busy"  # the peer that busy-waits


class _Answer(msgspec.Struct):
    lost: int
    cpu_ns: int


def run(job: Job) -> Round:
    with tempfile.TemporaryDirectory(prefix="catenary-peer-") as name:
        folder = Path(name)
        program = compile_peer(job.peer, folder)
        with ordinary_scheduling():
            cycle = bring_up(job)
        lines = "\n".join([*_settings(job, folder), *_places(cycle)]) + "\n"
        seconds = 30.0 + (job.warm_up + job.cycles) * job.period_ns * 1e-9
        done = subprocess.run(
            [program], input=lines, capture_output=True, text=True, timeout=seconds, check=False
        )
        if done.returncode != 0:
            raise CatenaryError(f"{job.peer}: {done.stderr.strip() or 'failed'}")
        answer = msgspec.json.decode(done.stdout, type=_Answer)
        samples = np.fromfile(folder / "samples", np.int64).reshape(-1, len(PHASES))
    return Round(samples, answer.lost, answer.cpu_ns / job.cycles)


@contextlib.contextmanager
def ordinary_scheduling() -> Iterator[None]:
    """Run the block with ordinary scheduling.

    The C program needs the priority of this process, but the bring-up does not. On a shared
    processor, it would prevent another network's segment from answering in time.
    """
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, parameters)


def bring_up(job: Job) -> CyclePlan:
    """Prepare the segment for SAFE-OP. Plan and frame are those of Catenary's loop."""
    with cat.MainDevice(job.interface) as main:
        subs = main.scan()
        arm = cat.Drives(
            [subs[position] for position in job.drives],
            mode=MODE[job.body],
            counts_per_turn=job.counts_per_turn,
            velocity_limit=100.0,
        )
        plan = main.plan(arm, period=job.period_ns * 1e-9)
        main.configure(plan)
        return plan.cycle


def _settings(job: Job, folder: Path) -> Iterator[str]:
    yield f"interface {job.interface}"
    yield f"samples {folder / 'samples'}"
    yield f"body {BODY[job.body]}"
    for name in ("period_ns", "cycles", "warm_up", "amplitude", "stiffness", "damping"):
        yield f"{name} {getattr(job, name)}"
    yield f"busy_wait_ns {round(job.busy_wait * 1e9) if job.peer == BUSY else 0}"
    yield f"counts_per_rad {job.counts_per_rad}"
    yield f"counts_per_torque {job.counts_per_torque}"
    for state in (*WAY_TO_OPERATIONAL, AlState.INIT):  # the last one is for leaving
        request = Datagram(EcatCommand.BWR, AL_CONTROL.address << 16, AL_CONTROL.pack(state))
        yield f"request {state.value} {encode_frame([request]).hex()}"


def _places(cycle: CyclePlan) -> Iterator[str]:
    """Yield the frame of the cycle and the offsets of its words [bytes]."""
    if len(cycle.frames) != 1:
        raise CatenaryError(
            f"the C peers support one frame per cycle; this cycle has {len(cycle.frames)}",
            hint="use fewer drives: --drives 33",
        )
    [frame] = cycle.frames
    yield f"frame {frame.template.hex()}"
    for datagram in frame.datagrams:
        yield f"datagram {datagram.offset} {datagram.length} {datagram.expected_counter}"
        if datagram.kind is DatagramKind.AL_STATUS:
            yield f"al_status {datagram.offset + DATAGRAM_HEADER}"
    for axis in cycle.axes:
        yield f"axis {' '.join(map(str, _axis(axis, frame)))}"


def _axis(axis: AxisPlan, frame: FramePlan) -> list[int]:
    outputs = (axis.controlword, axis.mode_target, axis.target_position, axis.target_torque)
    inputs = (axis.statusword, axis.actual_position, axis.actual_velocity)
    return [
        *(_place(number, frame, outputs=True) for number in outputs),
        *(_place(number, frame, outputs=False) for number in inputs),
    ]


def _place(number: Number | None, frame: FramePlan, *, outputs: bool) -> int:
    """Convert an offset in the image to an offset in the frame."""
    if number is None or number.bit_offset % 8:
        raise CatenaryError("the C peers need all words of the drives, aligned to bytes")
    at = number.bit_offset // 8
    for datagram in frame.datagrams:
        for copy in datagram.outputs if outputs else datagram.inputs:
            if copy.image_offset <= at < copy.image_offset + copy.size:
                return copy.frame_offset + at - copy.image_offset
    raise CatenaryError("no frame of the cycle contains this word of a drive")

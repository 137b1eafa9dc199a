"""The C peers. Catenary brings the segment to PRE-OP, sets SyncManagers and FMMUs, and closes its
link; the C program gets the frame of the cycle and the places of the words in it, asks for SAFE-OP
and OP itself (valid outputs must flow meanwhile) and runs the same cycle as the others."""

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
from catenary.bench.compiler import compile_peer
from catenary.bench.job import PHASES, Body, Job, Round
from catenary.errors import CatenaryError
from catenary.plan.cycle import AxisPlan, CyclePlan, DatagramKind, FramePlan, Number
from catenary.wire.al import State
from catenary.wire.datagram import Command, Datagram
from catenary.wire.frame import encode_frame
from catenary.wire.register import AL_CONTROL

BODY = {Body.SINE: 0, Body.PD: 1}
MODE = {Body.SINE: "csp", Body.PD: "cst"}
WAY_TO_OPERATIONAL = (State.PRE_OP, State.SAFE_OP, State.OP)
DATAGRAM_HEADER = 10


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
    return Round(samples, answer.lost, answer.cpu_ns)


@contextlib.contextmanager
def ordinary_scheduling() -> Iterator[None]:
    """The program inherits this process' priority. Bring-up needs none: where all share a processor
    it would keep another network's segment from answering in time."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, parameters)


def bring_up(job: Job) -> CyclePlan:
    """Leaves the segment ready to be asked for SAFE-OP; the plan is that of Catenary's own loop, so
    the frame is the same."""
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
    yield f"counts_per_rad {job.counts_per_rad}"
    yield f"counts_per_torque {job.counts_per_torque}"
    for state in (*WAY_TO_OPERATIONAL, State.INIT):  # the last one is for leaving
        request = Datagram(Command.BWR, AL_CONTROL.address << 16, AL_CONTROL.pack(state))
        yield f"request {state.value} {encode_frame([request]).hex()}"


def _places(cycle: CyclePlan) -> Iterator[str]:
    """The frame of the cycle, and where in it the words are [bytes]."""
    if len(cycle.frames) != 1:
        raise CatenaryError(
            f"the C peers know a cycle of one frame, and this one has {len(cycle.frames)}",
            hint="fewer drives: --drives 33",
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
    """From an offset in the image to one in the frame."""
    if number is None or number.bit_offset % 8:
        raise CatenaryError("the C peers need every word of the drives, on whole bytes")
    at = number.bit_offset // 8
    for datagram in frame.datagrams:
        for copy in datagram.outputs if outputs else datagram.inputs:
            if copy.image_offset <= at < copy.image_offset + copy.size:
                return copy.frame_offset + at - copy.image_offset
    raise CatenaryError("a word of a drive is in no frame of the cycle")

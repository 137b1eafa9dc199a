"""A bench for the engine: plans made by hand, and a link written in Python whose far end is a row
of scripted drives. Everything happens in virtual time; the tests lose, repeat and spoil its frames.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from catenary.core import CYCLE_OK, Engine
from catenary.plan.cycle import (
    AxisLimits,
    AxisPlan,
    Column,
    Copy,
    CyclePlan,
    DatagramKind,
    DatagramPlan,
    FramePlan,
    Number,
    NumberKind,
    SyncUnit,
)
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.link_table import (
    NOW,
    RECEIVE,
    SEND,
    WAIT_UNTIL,
    Table,
    capsule_of,
)

MS = 1_000_000
PERIOD = MS
CSP, CSV, CST = 8, 9, 10
DRIVE_SIZE = 13  # controlword, mode, velocity, position, torque; and back
COUNTS = 1000.0  # per radian
NM = 0.001  # of one count of torque
LOGICAL = 0x10000

TICK = 1_000  # [ns] a ticking clock goes on whenever it is read

LINK_NAME = b"catenary.link"
LAW_NAME = b"catenary.law"


class ScriptedLink:
    """Owns the frames under way. `answer(frame)` says what comes back: (delay [ns], frame)."""

    def __init__(self, answer: Callable[[bytes], Sequence[tuple[int, bytes]]]) -> None:
        self.time = 0
        self.answer = answer
        self.sent: list[bytes] = []
        self.arrivals: list[tuple[int, bytes]] = []
        self.send_result = 0
        self.wait_results: list[int] = []  # of the next waits, instead of waiting
        self.waits: list[int] = []
        self.lent = ctypes.create_string_buffer(2048)
        self.table = Table(
            1,
            1,
            None,
            SEND(self.table_send),
            RECEIVE(self.table_receive),
            NOW(lambda _: self.time),
            WAIT_UNTIL(self.table_wait_until),
        )
        self.capsule = capsule_of(self.table, LINK_NAME)

    def table_send(self, _, frame, length) -> int:
        if self.send_result < 0:
            return self.send_result
        self.sent.append(bytes(frame[:length]))
        for delay, back in self.answer(self.sent[-1]):
            self.arrive(back, delay)
        return 0

    def arrive(self, frame: bytes, delay: int = 0) -> None:
        self.arrivals.append((self.time + delay, frame))
        self.arrivals.sort(key=lambda arrival: arrival[0])

    def table_receive(self, _, frame) -> int:
        if not self.arrivals or self.arrivals[0][0] > self.time:
            return 0
        _, bytes_ = self.arrivals.pop(0)
        ctypes.memmove(self.lent, bytes_, len(bytes_))
        frame[0] = ctypes.cast(self.lent, ctypes.POINTER(ctypes.c_uint8))
        return len(bytes_)

    def table_wait_until(self, _, deadline, wake_on_frame) -> int:
        self.waits.append(deadline)
        if self.wait_results:
            return self.wait_results.pop(0)
        if wake_on_frame and self.arrivals and self.arrivals[0][0] <= deadline:
            self.time = max(self.time, self.arrivals[0][0])
            return 1
        self.time = max(self.time, deadline)
        return 0


class TickingLink(ScriptedLink):
    """Like a NIC: time passes by itself."""

    def __init__(self, answer: Callable[[bytes], Sequence[tuple[int, bytes]]]) -> None:
        super().__init__(answer)
        self.table.flags = 0
        self.table.now = NOW(self.tick)

    def tick(self, _) -> int:
        self.time += TICK
        return self.time


STATUS = (0x0000, 0x0240, 0x0221, 0x0223, 0x1227, 0x0207, 0x021F, 0x0218)  # by CiA 402 state


@dataclass
class ScriptedDrive:
    """A drive that obeys at once: commands move it one transition a frame."""

    state: int = 1
    position: int = 0  # counts
    velocity: int = 0
    torque: int = 0
    mode_shown: int | None = None  # None: as asked
    follows: bool = True  # bit 12
    stays_in_quick_stop: bool = False
    controlword: int = 0
    mode: int = 0
    target_velocity: int = 0
    target_position: int = 0
    target_torque: int = 0
    moves: bool = True  # the position follows in CSP

    def exchange(self, outputs: bytes) -> bytes:
        before = self.controlword
        self.controlword = int.from_bytes(outputs[0:2], "little")
        self.mode = outputs[2]
        self.target_velocity = int.from_bytes(outputs[3:7], "little", signed=True)
        self.target_position = int.from_bytes(outputs[7:11], "little", signed=True)
        self.target_torque = int.from_bytes(outputs[11:13], "little", signed=True)
        self.state = self.after(before)
        if self.state == 4 and self.mode == CSP and self.moves:
            self.position = self.target_position
        return self.inputs()

    def inputs(self) -> bytes:
        status = STATUS[self.state]
        if not self.follows:
            status &= ~0x1000
        shown = self.mode if self.mode_shown is None else self.mode_shown
        position = (self.position + 2**31) % 2**32 - 2**31
        return b"".join(
            (
                status.to_bytes(2, "little"),
                bytes([shown]),
                self.velocity.to_bytes(4, "little", signed=True),
                position.to_bytes(4, "little", signed=True),
                self.torque.to_bytes(2, "little", signed=True),
            )
        )

    def after(self, before: int) -> int:
        command = self.controlword & 0x8F
        if self.state == 7:
            return 1 if command & 0x80 and not before & 0x80 else 7
        if self.state == 6:
            return 7
        if self.state == 1:
            return 2 if command == 0x06 else 1
        if self.state == 5:
            return 1 if not command & 0x02 or not self.stays_in_quick_stop else 5
        if not command & 0x02:
            return 1
        if not command & 0x04:
            return 5 if self.state == 4 else 1
        return self.powered(command)

    def powered(self, command: int) -> int:
        if command == 0x06:
            return 2
        if command == 0x07:
            return 3
        if command == 0x0F:
            return 4 if self.state >= 3 else 3
        return self.state


class Segment:
    """The far end: each drive `DRIVE_SIZE` bytes at its place in the logical memory."""

    def __init__(self, drives: Sequence[ScriptedDrive]) -> None:
        self.drives = list(drives)
        self.silent: set[int] = set()  # drives that do not answer
        self.al_state = 8
        self.delay = 100_000
        self.spoil: Callable[[bytes], Sequence[tuple[int, bytes]]] | None = None

    def answer(self, frame: bytes) -> Sequence[tuple[int, bytes]]:
        decoded = decode_frame(frame)
        datagrams = tuple(self.process(d) for d in decoded.datagrams)
        source = bytes([decoded.source[0] | 2]) + decoded.source[1:]
        back = replace(decoded, datagrams=datagrams, source=source).encode()
        return self.spoil(back) if self.spoil else [(self.delay, back)]

    def process(self, datagram: Datagram) -> Datagram:
        answering = [k for k in range(len(self.drives)) if k not in self.silent]
        if datagram.command == EcatCommand.BRD:
            address = datagram.address + len(self.drives)  # every device counts ADP up
            data = bytes([self.al_state if answering else 0, 0])
            return replace(datagram, address=address, data=data, working_counter=len(answering))
        if datagram.command == EcatCommand.LRW:
            return self.process_logical(datagram, answering)
        if datagram.command == EcatCommand.NOP:
            return datagram
        return replace(datagram, working_counter=len(answering))

    def process_logical(self, datagram: Datagram, answering: list[int]) -> Datagram:
        data, counter = bytearray(datagram.data), 0
        for k in answering:
            start = LOGICAL + k * DRIVE_SIZE - datagram.address
            if 0 <= start < len(data):
                outputs = bytes(data[start : start + DRIVE_SIZE])
                data[start : start + DRIVE_SIZE] = self.drives[k].exchange(outputs)
                counter += 3
        return replace(datagram, data=bytes(data), working_counter=counter)


def number(byte: int, bits: int, kind: NumberKind = NumberKind.SIGNED, **more: float) -> Number:
    return Number(byte * 8, bits, kind, **more)


def axis(k: int, *, mode: int = CSP, limits: AxisLimits | None = None, **more: object) -> AxisPlan:
    """Axis k, at byte k * 13 of both images, its own sync unit k."""
    at = k * DRIVE_SIZE
    plan = AxisPlan(
        name=f"axis {k}",
        device=k,
        slot=0,
        sync_unit=k,
        mode=mode,
        controlword=number(at, 16, NumberKind.UNSIGNED),
        mode_target=number(at + 2, 8),
        target_velocity=number(at + 3, 32, scale=1 / COUNTS),
        target_position=number(at + 7, 32, scale=1 / COUNTS),
        target_torque=number(at + 11, 16, scale=NM),
        statusword=number(at, 16, NumberKind.UNSIGNED),
        mode_actual=number(at + 2, 8),
        actual_velocity=number(at + 3, 32, scale=1 / COUNTS),
        actual_position=number(at + 7, 32, scale=1 / COUNTS),
        actual_torque=number(at + 11, 16, scale=NM),
        limits=limits or AxisLimits(),
    )
    return replace(plan, **more)


def frame_plan(parts: Sequence[tuple[DatagramKind, Datagram, int, int]]) -> FramePlan:
    """parts: kind, datagram, expected counter, sync unit; all data is copied both ways, to the
    image offset that its logical address says."""
    datagrams, offset = [], 16
    for kind, datagram, counter, unit in parts:
        copies: tuple[Copy, ...] = ()
        if datagram.command in (EcatCommand.LRW, EcatCommand.LRD, EcatCommand.LWR):
            copies = (Copy(offset + 10, datagram.address - LOGICAL, len(datagram.data)),)
        reads = datagram.command != EcatCommand.LWR
        writes = datagram.command != EcatCommand.LRD
        datagrams.append(
            DatagramPlan(
                kind,
                datagram.command,
                offset,
                len(datagram.data),
                counter,
                unit,
                outputs=copies if writes else (),
                inputs=copies if reads else (),
            )
        )
        offset += 12 + len(datagram.data)
    return FramePlan(encode_frame([part[1] for part in parts]), tuple(datagrams))


def al_status(devices: int) -> tuple[DatagramKind, Datagram, int, int]:
    brd = Datagram(EcatCommand.BRD, 0x0130 << 16, bytes(2))
    return DatagramKind.AL_STATUS, brd, devices, -1


def cycle_number() -> tuple[DatagramKind, Datagram, int, int]:
    return DatagramKind.CYCLE_NUMBER, Datagram(EcatCommand.NOP, 0, bytes(4)), 0, -1


def lrw(unit: int, size: int = DRIVE_SIZE) -> tuple[DatagramKind, Datagram, int, int]:
    datagram = Datagram(EcatCommand.LRW, LOGICAL + unit * DRIVE_SIZE, bytes(size))
    return DatagramKind.PROCESS_DATA, datagram, 3, unit


def make_plan(
    axes: Sequence[AxisPlan] = (), *, units: int | None = None, **more: object
) -> CyclePlan:
    """One LRW datagram and sync unit per axis, with a BRD, in one frame."""
    count = len(axes) if units is None else units
    plan = CyclePlan(
        period_ns=PERIOD,
        execution="threaded",
        receive_mode="wait",
        collect_deadline_ns=PERIOD // 2,
        output_size=count * DRIVE_SIZE,
        input_size=count * DRIVE_SIZE,
        frames=(frame_plan([al_status(count), *(lrw(k) for k in range(count))]),),
        sync_units=tuple(SyncUnit(f"unit {k}", (k,)) for k in range(count)),
        device_count=count,
        axes=tuple(axes),
        acyclic_ns=PERIOD * 4 // 5,
    )
    return replace(plan, **more)


@dataclass
class Bench:
    """An engine, its arrays, and what is at the other end."""

    plan: CyclePlan
    drives: list[ScriptedDrive] = field(default_factory=list)
    link_type: type[ScriptedLink] = ScriptedLink

    def __post_init__(self) -> None:
        count = len(self.plan.sync_units)
        self.drives = self.drives or [ScriptedDrive() for _ in range(count)]
        self.segment = Segment(self.drives)
        self.link = self.link_type(self.segment.answer)
        self.engine = Engine(self.plan, self.link.capsule)
        for name, buffer in self.engine.buffers.items():
            setattr(self, name, np.asarray(buffer))
        self.engine.start()

    def ask(self, requested_state: int) -> None:
        self.requested_state[:] = requested_state
        self.request[:] += 1

    def enable(self) -> None:
        """Enabled and holding, as a Loop would."""
        self.ask(1)
        self.engine.run(10)
        assert all(self.axis_flags & 1), (self.axis_state, self.axis_flags)

    def steps(self, count: int) -> int:
        flags = 0
        for _ in range(count):
            flags = self.engine.next()
        return flags

    @property
    def ok(self) -> bool:
        return bool(self.engine.flags & CYCLE_OK)


def bench(*axes: AxisPlan, drives: Sequence[ScriptedDrive] = (), **more: object) -> Bench:
    return Bench(make_plan(axes, **more), list(drives))


def column(name: str, at: Number, bank: int, unit: int = 0) -> Column:
    return Column(name, at, bank, 0, unit)


def is_close(a: float, b: float) -> bool:
    return math.isclose(a, b, abs_tol=1e-9)

"""`python -m benchmarks table rteml`: intervals of captured cyclic frames at 5 kHz.

A raw socket at the segment's end of the wire captures the frames with the kernel's time stamps. At
the loop's end, frames that bypass the queueing discipline are not visible to other sockets.
"""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import msgspec
import numpy as np

import catenary as cat
from benchmarks.tables.published import RTEML_CONDITIONS, RTEML_INTERVAL_US, RTEML_PACKETS
from benchmarks.tables.sheet import Options, Sheet, grid
from catenary.bench.loop import show_progress
from catenary.bench.python_loop import LATE_LIMIT, LOST_LIMIT
from catenary.bench.rounds import BRING_UP_SECONDS, WARM_UP_CYCLES, RoundError
from catenary.bench.segment import PRIORITY, processors, served
from catenary.bench.statistics import summarise
from catenary.realtime.child import Child, start_python

RATE = 5000
ORDERS: tuple[Literal["threaded", "inline"], ...] = ("threaded", "inline")
ETHERCAT = 0x88A4
SO_TIMESTAMPNS, SO_RCVBUFFORCE = 35, 33  # asm-generic/socket.h
SOL_PACKET, PACKET_STATISTICS = 263, 6  # linux/if_packet.h
ROOM = 64 << 20  # [bytes] size of the socket's buffer
LONGEST = 2048  # [bytes] limit of a frame
INDEX = 17  # offset of the first datagram's index; indices of the cycle are below ACYCLIC
ACYCLIC = 0x80
TIMESPEC = struct.Struct("@qq")


class Stretch(msgspec.Struct):
    """Report of the loop: the time span of its counted cycles (CLOCK_REALTIME) and the counts."""

    start_ns: int
    end_ns: int
    cycles: int
    lost: int
    scheduling: str


@dataclass(frozen=True, slots=True)
class Capture:
    """Cyclic frames on the wire in the same time span."""

    stamps_ns: tuple[int, ...]
    sizes: tuple[int, ...]  # [bytes], without check sequence
    dropped: int


def measure(options: Options) -> Sheet:
    seconds = options.seconds or RTEML_PACKETS / RATE
    rate = (options.rates or (RATE,))[0]
    left_out = []
    ours: dict[str, tuple[Capture, Stretch]] = {}
    if options.refused:
        left_out.append(f"all of ours: no private network ({options.refused})")
    else:
        for number, order in enumerate(ORDERS):
            show_progress(order, number + 1, len(ORDERS))
            ours[f"catenary-{order}"] = run(order, rate, round(seconds * rate))
    rows = [["theirs", str(RTEML_PACKETS), "60", f"{RTEML_INTERVAL_US:.1f}", *["-"] * 4]]
    rows += [row(name, *each) for name, each in ours.items()]
    return Sheet(
        title=f"RtEML, intervals of cyclic frames; {RTEML_CONDITIONS}",
        conditions=f"ours: 4 analogue inputs on a veth, {rate} Hz, captured at their end",
        text=grid(
            ("", "packets", "bytes", "interval [us] mean", "max", "min", "sd", "cycles lost"), rows
        ),
        figures={
            "published": {"packets": RTEML_PACKETS, "bytes": 60, "mean_us": RTEML_INTERVAL_US},
            "rate": rate,
            "ways": {name: as_figures(*each) for name, each in ours.items()},
        },
        left_out=left_out,
    )


def run(order: str, rate: int, cycles: int) -> tuple[Capture, Stretch]:
    """Run the loop in a separate process, and capture its frames in this one."""
    with served(0, inputs=1) as segment, contextlib.ExitStack() as stack:
        wire = stack.enter_context(open_capture(segment.far))
        cpu = processors().masters
        words = [segment.interface, order, str(rate), str(cycles), "" if cpu is None else str(cpu)]
        worker = stack.enter_context(start_python(["-m", __name__, *words]))
        frames, said = read_until(wire, worker, BRING_UP_SECONDS + 2 * cycles / rate)
        stretch = msgspec.json.decode(said, type=Stretch)
        return cyclic(frames, stretch, dropped(wire)), stretch


# The capture


def open_capture(interface: str) -> socket.socket:
    wire = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
    wire.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    with contextlib.suppress(PermissionError):  # then the default buffer size applies
        wire.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, ROOM)
    wire.bind((interface, ETHERCAT))
    wire.setblocking(False)
    return wire


Frame = tuple[int, bytes]  # CLOCK_REALTIME [ns], from the first byte


def read_until(wire: socket.socket, worker: Child, seconds: float) -> tuple[list[Frame], str]:
    """Return all frames until the worker prints a line, and that line."""
    output = worker.process.stdout
    assert output is not None
    frames: list[Frame] = []
    deadline = time.monotonic() + seconds
    while True:
        left = deadline - time.monotonic()
        places = wire.fileno(), output.fileno()
        ready = select.select(places, [], [], max(left, 0.0))[0]
        if wire.fileno() in ready:
            frames += drain(wire)
        if output.fileno() in ready or not ready:
            line = worker.read_line(1.0)
            if line is None or not line.startswith("{"):
                raise RoundError(f"the loop failed: {line or 'no output'}")
            return frames + drain(wire), line


def drain(wire: socket.socket) -> list[Frame]:
    frames: list[Frame] = []
    while True:
        try:
            data, ancillary, _flags, sender = wire.recvmsg(LONGEST, 64)
        except BlockingIOError:
            return frames
        if sender[2] == socket.PACKET_OUTGOING:
            continue
        for level, kind, value in ancillary:
            if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS):
                seconds, nanoseconds = TIMESPEC.unpack(value)
                frames.append((seconds * 1_000_000_000 + nanoseconds, data))


def dropped(wire: socket.socket) -> int:
    """Return the number of frames that did not fit in the buffer."""
    statistics = wire.getsockopt(SOL_PACKET, PACKET_STATISTICS, 8)
    return int(struct.unpack("II", statistics)[1])


def cyclic(frames: Sequence[Frame], stretch: Stretch, lacking: int) -> Capture:
    """Return the cyclic frames within the counted time span."""
    mine = [
        (stamp, len(data))
        for stamp, data in frames
        if stretch.start_ns <= stamp <= stretch.end_ns
        and len(data) > INDEX
        and data[INDEX] < ACYCLIC
    ]
    return Capture(tuple(s for s, _ in mine), tuple(size for _, size in mine), lacking)


# Output as text and as figures


def intervals_us(capture: Capture) -> dict[str, float]:
    if len(capture.stamps_ns) < 2:
        raise RoundError(f"only {len(capture.stamps_ns)} frames were captured; 2 are needed")
    return summarise(np.diff(np.array(capture.stamps_ns)) * 1e-3)


def row(name: str, capture: Capture, stretch: Stretch) -> list[str]:
    found = intervals_us(capture)
    sizes = "/".join(map(str, sorted(set(capture.sizes))))
    texts = [f"{found[figure]:.1f}" for figure in ("mean", "max", "min", "sd")]
    lost = f"{stretch.lost} of {stretch.cycles}"
    return [name, str(len(capture.stamps_ns)), sizes, *texts, lost]


def as_figures(capture: Capture, stretch: Stretch) -> dict[str, object]:
    return {
        "packets": len(capture.stamps_ns),
        "sizes": sorted(set(capture.sizes)),
        "not_captured": capture.dropped,
        "interval_us": intervals_us(capture),
        "loop": msgspec.to_builtins(stretch),
    }


# Process of the loop


def main(arguments: Sequence[str]) -> None:
    interface, order, rate, cycles, cpu = arguments
    stretch = exchange(interface, order, int(rate), int(cycles), int(cpu) if cpu else None)
    print(msgspec.json.encode(stretch).decode(), flush=True)


def exchange(interface: str, order: str, rate: int, cycles: int, cpu: int | None) -> Stretch:
    with cat.MainDevice(interface) as main:
        terminal = cat.Inputs(main.scan()[1])
        with cat.Loop(
            terminal,
            period=1 / rate,
            execution="inline" if order == "inline" else "threaded",
            cpu=cpu,
            priority=PRIORITY,
            stop=cat.StopPolicy(lost_limit=LOST_LIMIT, late_limit=LATE_LIMIT),
        ) as loop:
            before, start, last = loop.timing.counters, 0, 0
            for cycle in loop:
                if not start and cycle.number >= WARM_UP_CYCLES:
                    before, start = loop.timing.counters, time.time_ns()
                    last = cycle.number + cycles
                elif start and cycle.number >= last:
                    break
            end, after = time.time_ns(), loop.timing.counters
            count, lost = (after[name] - before[name] for name in ("cycles", "lost"))
            return Stretch(start, end, count, lost, loop.scheduling)


if __name__ == "__main__":
    main(sys.argv[1:])

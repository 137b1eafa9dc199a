"""Segment of the benchmarks: a coupler and drives, served on a network interface.

`python -m catenary.bench.segment NIC SECOND DRIVES INPUTS AXES CPU` is the process that serves it.
SECOND is the second interface of a ring, or empty.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Literal

from catenary.demo.server import serve_at_priority
from catenary.errors import LinkError
from catenary.realtime import VirtualClock
from catenary.realtime.child import start_python
from catenary.realtime.private_network import veth_pair
from catenary.virtual import AnalogInputs, Coupler, Segment, Servo

START_SECONDS = 30.0
COUNTS_PER_TURN = 2**20
RATED_TORQUE = 2.0  # [N·m]
PRIORITY = 80
BELOW = 10  # reduction of the segment's priority if it shares the only processor with the loop
ANALOG_CHANNELS = 4  # per input terminal


@dataclass(frozen=True, slots=True)
class Served:
    interface: str  # of the MainDevice
    drives: tuple[int, ...]  # positions
    second: str = ""  # second interface of the MainDevice if the segment is a ring
    far: str = ""  # network interface of the segment
    pid: int = 0  # process that serves the segment


@dataclass(frozen=True, slots=True)
class Processors:
    """Processors of the segment and of all masters; None if there is only one processor."""

    segment: int | None
    masters: int | None


def processors() -> Processors:
    allowed = sorted(os.sched_getaffinity(0))
    if len(allowed) < 2:
        return Processors(None, None)
    return Processors(allowed[0], allowed[-1])


def make_segment(
    drives: int,
    inputs: int = 0,
    *,
    axes: int = 1,
    clock: Literal["virtual", "monotonic"] | VirtualClock = "monotonic",
    ring: bool = False,
) -> Segment:
    """Make a segment with a coupler, servos and analogue input terminals.

    Args:
        drives: Number of servos.
        inputs: Number of input terminals. They enlarge the process data without adding axes.
        axes: Axes per servo.
        clock: Clock of the segment.
        ring: True for a ring.
    """
    servos = [
        Servo(counts_per_turn=COUNTS_PER_TURN, rated_torque=RATED_TORQUE, axes=axes)
        for _ in range(drives)
    ]
    terminals = [AnalogInputs(channels=ANALOG_CHANNELS) for _ in range(inputs)]
    return Segment([Coupler(), *servos, *terminals], clock=clock, ring=ring)


@contextmanager
def served(drives: int, inputs: int = 0, axes: int = 1, *, ring: bool = False) -> Iterator[Served]:
    """Serve the segment on one end of an interface pair, or of two pairs for a ring."""
    cpu = processors().segment
    with ExitStack() as stack:
        ours, theirs = stack.enter_context(veth_pair())
        second = their_second = ""
        if ring:
            second, their_second = stack.enter_context(veth_pair())
        numbers = map(str, (drives, inputs, axes))
        arguments = [theirs, their_second, *numbers, "" if cpu is None else str(cpu)]
        server = stack.enter_context(start_python(["-m", "catenary.bench.segment", *arguments]))
        if server.read_line(START_SECONDS) is None:
            raise LinkError(
                "the segment of the benchmark did not start: its process ended, or did not answer "
                f"within {START_SECONDS:g} s",
                hint="see the message of the process above, if there is one",
            )
        yield Served(ours, tuple(range(1, drives + 1)), second, theirs, server.pid)


def main(arguments: Sequence[str]) -> None:
    interface, second, drives, inputs, axes, cpu = arguments
    segment = make_segment(int(drives), int(inputs), axes=int(axes), ring=bool(second))
    priority = PRIORITY if cpu else PRIORITY - BELOW
    own = int(cpu) if cpu else None
    serve_at_priority(segment, interface, priority, second=second or None, cpu=own)


if __name__ == "__main__":
    main(sys.argv[1:])

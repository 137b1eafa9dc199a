"""Machine of the soak: a ring with clocks, drives, files and an Ethernet port.

`python -m benchmarks.together.cell NIC SECOND` serves it on two network interfaces.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Literal

from catenary.bench.segment import PRIORITY, START_SECONDS
from catenary.demo.server import serve_at_priority
from catenary.errors import LinkError
from catenary.realtime.child import Child, start_python
from catenary.realtime.private_network import veth_pair
from catenary.virtual import (
    AnalogInputs,
    Coupler,
    Crystal,
    DeviceFiles,
    DigitalOutputs,
    Ethernet,
    Segment,
    Servo,
)

DRIVES, LAMPS, FILES, ETHERNET = (1, 2), 3, 4, 1  # positions
COUNTS_PER_TURN = 2**20
MAILBOX = 512  # [bytes]


def make_segment(clock: Literal["virtual", "monotonic"]) -> Segment:
    """Return the ring."""
    ethernet = Ethernet(ip="192.168.7.2", mac="02:00:00:00:07:02")
    return Segment(
        [
            Coupler(crystal=Crystal(ppm=20.0)),
            Servo(
                name="shoulder",
                counts_per_turn=COUNTS_PER_TURN,
                mailbox_bytes=MAILBOX,
                protocols=[ethernet],
                crystal=Crystal(ppm=-35.0),
            ),
            Servo(name="elbow", counts_per_turn=COUNTS_PER_TURN, crystal=Crystal(ppm=50.0)),
            DigitalOutputs(bits=8),
            AnalogInputs(files=DeviceFiles(), mailbox_bytes=MAILBOX),
        ],
        ring=True,
        clock=clock,
    )


@contextmanager
def served() -> Iterator[tuple[tuple[str, str], Child]]:
    """Serve the segment on two veth pairs. Yield our interfaces, and the process."""
    with ExitStack() as stack:
        ours, theirs = stack.enter_context(veth_pair())
        second, their_second = stack.enter_context(veth_pair())
        arguments = ["-m", "benchmarks.together.cell", theirs, their_second]
        server = stack.enter_context(start_python(arguments))
        if server.read_line(START_SECONDS) is None:
            raise LinkError("the segment of the soak did not start: see its message above")
        yield (ours, second), server


if __name__ == "__main__":
    serve_at_priority(make_segment("monotonic"), sys.argv[1], PRIORITY, second=sys.argv[2])

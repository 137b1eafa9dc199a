"""Virtual segments of a program, on interface pairs of its private network.

The segments remain objects of the program, which can push their plant or inject faults. Their
packet loops, and the thread of their plant, run without the GIL.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress

from catenary.link import Interface, LinkSource
from catenary.realtime.private_network import Private, state, veth_pair
from catenary.virtual import Segment, Server

PRIORITY = 80  # as high as a loop's: real devices do not wait for their MainDevice


@contextmanager
def on_wires(
    segments: Sequence[Segment], *, priority: int = PRIORITY
) -> Iterator[list[tuple[LinkSource, ...]]]:
    """Yield the targets of each segment: `MainDevice(*targets[0])`.

    In a private network (`python -m catenary.realtime.private_network program.py`), each segment is
    served on an interface pair, or on two for a ring, and the frames are real. Otherwise the links
    are in this process. All frames are answered, however late.

    Args:
        segments: Segments with clock="monotonic".
        priority: SCHED_FIFO priority of the threads of the segments, 1 to 99. If the machine
            refuses it, they run without.

    Raises:
        LinkError: An interface cannot be opened.
    """
    if not isinstance(state(), Private):
        yield [_ends(segment) for segment in segments]
        return
    with ExitStack() as stack:
        targets: list[tuple[LinkSource, ...]] = []
        for segment in segments:
            pairs = [stack.enter_context(veth_pair()) for _ in range(1 + segment.ring)]
            theirs = [their for _, their in pairs]
            second = theirs[1] if segment.ring else None
            server = Server(segment, theirs[0], second=second, max_age=None)
            with _at_priority(priority):
                stack.enter_context(server)
            targets.append(tuple(Interface(our) for our, _ in pairs))
        yield targets


@contextmanager
def _at_priority(priority: int) -> Iterator[None]:
    """Raise the priority of this thread, which the threads that it starts inherit."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


def _ends(segment: Segment) -> tuple[LinkSource, ...]:
    return (segment.first, segment.second) if segment.ring else (segment.first,)

"""The process that serves a segment for a demo or a benchmark, in real time if permitted."""

from __future__ import annotations

from functools import partial

from catenary.realtime.system.scheduling import request_scheduling
from catenary.virtual import Segment, serve
from catenary.virtual.server import MAX_AGE


def serve_at_priority(
    segment: Segment,
    interface: str,
    priority: int,
    *,
    second: str | None = None,
    cpu: int | None = None,
) -> None:
    """Serve the segment at SCHED_FIFO, and print "ready" when it answers.

    If the machine refuses the priority, late frames are answered, too. The machine causes the
    delay, and a demo must run on any machine.

    Args:
        segment: The segment to serve.
        interface: The network interface on which it answers.
        priority: SCHED_FIFO 1 to 99, for all threads of this process.
        second: The interface of a ring's other end.
        cpu: The processor of this process; None: any.
    """
    real_time = request_scheduling(priority=priority, cpu=cpu).real_time
    ready = partial(print, "ready", flush=True)
    max_age = MAX_AGE if real_time else None
    serve(segment, interface, second=second, max_age=max_age, ready=ready)

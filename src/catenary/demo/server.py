"""Process that serves a segment for a demo or a benchmark, in real time if permitted."""

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
    """Serve the segment at a SCHED_FIFO priority, and print "ready" when it answers.

    If the machine refuses the priority, the segment also answers late frames, because a demo must
    run on any machine.

    Args:
        segment: The segment to serve.
        interface: Network interface of the segment.
        priority: SCHED_FIFO priority of all threads of this process, 1 to 99.
        second: Second interface, for a ring.
        cpu: Processor of this process; None for any.
    """
    real_time = request_scheduling(priority=priority, cpu=cpu).real_time
    ready = partial(print, "ready", flush=True)
    max_age = MAX_AGE if real_time else None
    serve(segment, interface, second=second, max_age=max_age, ready=ready)

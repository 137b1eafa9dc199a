"""Server process of a demo or a benchmark."""

from __future__ import annotations

import pytest

from catenary.demo import server
from catenary.realtime.system.scheduling import Scheduling
from catenary.virtual import demo_segment
from catenary.virtual.server import MAX_AGE


@pytest.mark.parametrize(("policy", "max_age"), [("SCHED_FIFO", MAX_AGE), ("SCHED_OTHER", None)])
def test_late_frames_are_dropped_only_in_real_time(
    monkeypatch: pytest.MonkeyPatch, policy: str, max_age: float | None
) -> None:
    """If the machine refuses the priority, the segment answers late frames."""
    asked: dict[str, object] = {}
    served: dict[str, object] = {}

    def request(**options: object) -> Scheduling:
        asked.update(options)
        return Scheduling(policy, 80, False, (0,))

    monkeypatch.setattr(server, "request_scheduling", request)
    monkeypatch.setattr(server, "serve", lambda *_, **options: served.update(options))
    server.serve_at_priority(demo_segment(clock="monotonic"), "veth1", 80, cpu=1)
    assert asked == {"priority": 80, "cpu": 1}
    assert served["max_age"] == max_age

"""What is rehearsed in the lead fits into it."""

from __future__ import annotations

import catenary as cat
from catenary.loop.rehearsal import fastest, fitting_rehearsal, make_rehearsal
from catenary.virtual import Segment, Servo

HOUR = 3_600_000_000_000  # [ns]


def test_the_fastest_of_some_calls_counts() -> None:
    now, steps = 0, [900, 40, 70, 2000, 50]

    def work() -> None:
        nonlocal now
        now += steps.pop(0)

    assert fastest(work, clock=lambda: now) == 40


def test_a_rehearsal_that_does_not_fit_is_left_out_and_one_that_does_writes_nothing() -> None:
    with cat.MainDevice(Segment([Servo(), Servo()], clock="virtual")) as main:
        arm = cat.Drives(main.scan().drives, mode="csp", counts_per_turn=1 << 20)
        with cat.Loop(arm, period=1e-3, run="inline") as loop:
            next(iter(loop))
            views = loop._running.views
            assert fitting_rehearsal(views, lead_ns=1) is None
            rehearsal = fitting_rehearsal(views, lead_ns=HOUR)
            assert rehearsal is not None
            before = arm.target.position.copy()
            rehearsal()
            make_rehearsal(views)()
            assert (arm.target.position == before).all()

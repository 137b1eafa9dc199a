"""`cycle.time`, the events and the log have the same clock."""

from __future__ import annotations

import pytest

import catenary as cat
from catenary.bus.event_types import Event
from catenary.realtime import VirtualClock
from catenary.virtual import Segment, Servo


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_events_and_cycles_have_one_clock(execution: str) -> None:
    told: list[Event] = []
    with cat.MainDevice(Segment([Servo(name="arm")])) as main:
        main.on_event(told.append)
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with cat.Loop(arm, execution=execution) as loop:
            for cycle in loop:
                if cycle.number == 100:
                    main.mark("now")
                    marked = cycle.time
                if cycle.number == 110:
                    break
            [event] = main.events
            row = loop.log[loop.log["number"] == loop.log["number"][-1] - 10]
        assert event.time == pytest.approx(marked, abs=1e-3)
        assert row["time"][0] == pytest.approx(marked)
        assert [each.time for each in told] == [event.time]


def test_after_the_loop_times_are_of_the_link() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
        with cat.Loop(arm) as loop:
            for cycle in loop:
                if cycle.number == 50:
                    break
        main.mark("after")
        [event] = main.events
        assert event.time == pytest.approx(main.link.now() * 1e-9)


def test_networks_of_one_loop_have_one_clock() -> None:
    with (
        VirtualClock() as clock,
        cat.MainDevice(Segment([Servo()], clock=clock)) as upper,
        cat.MainDevice(Segment([Servo()], clock=clock)) as lower,
    ):
        both = [
            cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
            for main in (upper, lower)
        ]
        with cat.Loop(*both) as loop:
            for cycle in loop:
                if cycle.number == 100:
                    break
            marked = cycle.time
            lower.mark("now")
            [event] = lower.events
        zeros = [n.log["scheduled_ns"][-1] * 1e-9 - n.log["time"][-1] for n in loop.networks]
        assert event.time == pytest.approx(marked, abs=1e-3)
        assert zeros[0] == pytest.approx(zeros[1], abs=1e-9)

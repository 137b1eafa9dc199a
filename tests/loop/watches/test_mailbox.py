"""Emergencies in real time: the service thread reads a mailbox whose bit is set."""

from __future__ import annotations

from typing import Literal

import pytest

import catenary as cat
from catenary.bus.event_types import Emergency, Event
from catenary.virtual import Coupler, Segment, Server, Servo

PATIENCE = 30_000  # cycles of 2 ms: a machine may stop for as long as it likes before that


@pytest.mark.parametrize("run", ["threaded", "inline"])
def test_an_emergency_arrives_over_the_wire(
    veth: tuple[str, str], run: Literal["threaded", "inline"]
) -> None:
    servo = Servo()
    told: list[Event] = []
    with (
        Server(Segment([Coupler(), servo], clock="monotonic"), veth[1], max_age=None),
        cat.MainDevice(veth[0]) as main,
    ):
        main.on_event(told.append)
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=100.0)
        with cat.Loop(
            arm,
            period=2e-3,
            execution=run,
            stop=cat.StopPolicy(raise_faults=False, lost_limit=PATIENCE, late_limit=0),
            watchdog=0,
        ) as loop:
            found: list[Event] = []
            for cycle in loop:
                if cycle.number == 10:
                    servo.inject_fault(0x7305)
                found += [event for event in main.events if isinstance(event, Emergency)]
                if found or cycle.number > PATIENCE:
                    break
    [event] = found
    assert event.error_code == 0x7305
    assert event in told  # delivered by its thread, at the latest when the MainDevice is closed

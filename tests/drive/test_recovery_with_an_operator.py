"""Recovery of drives that an operator in another process stops, enables and jogs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

import catenary as cat
from catenary.drive import Phase, Recovery
from catenary.plan.stop_reason import StopReason
from catenary.share import Lease, Reader
from catenary.virtual import Servo
from catenary.virtual.faults import drive_fault
from tests.share.names import own_name

STARTING, RUNNING, STOPPED = Phase
PATIENT = cat.StopPolicy(raise_faults=False, on_axis_stopped="event")


class Rig:
    """Two drives with a recovery, and an operator with a lease on both."""

    def __init__(self, arm: cat.Drives, loop: cat.Loop, reader: Reader, lease: Lease) -> None:
        self.arm, self.loop, self.reader, self.lease = arm, loop, reader, lease
        self.recovery = Recovery(arm, after=0.1, patience=0.5)
        self.reason: Callable[[], str | None] = lambda: None

    def run(self, cycles: int) -> Phase:
        for _ in range(cycles):
            phase = self.recovery.step(next(self.loop), self.reason())
        return phase


@contextmanager
def rig(*faults: object) -> Iterator[Rig]:
    segment = cat.Segment([Servo(), Servo()])
    for fault in faults:
        segment.inject(fault)  # type: ignore[arg-type]
    with own_name("recovery") as name, cat.MainDevice(segment) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with (
            cat.Share(name, jog=True) as share,
            cat.Loop(arm, period=1e-3, sink=share, stop=PATIENT) as loop,
            cat.attach(name) as reader,
            reader.lease(for_=3600.0) as lease,
        ):
            there = Rig(arm, loop, reader, lease)
            assert there.run(50) == RUNNING
            yield there


def test_a_jog_is_no_reason_to_stop() -> None:
    with rig() as there, there.lease.jog(0, 0.5) as jog:
        for _ in range(700):  # longer than `patience`
            jog.beat()
            assert there.run(1) == RUNNING
        assert jog.status.name == "MOVING"
        assert there.recovery.stops == []


def test_drives_are_not_enabled_after_the_stop_of_an_operator() -> None:
    with rig() as there:
        there.reader.stop()
        assert there.run(2000) == STOPPED
        assert not there.arm.enabled.any()
        assert [stop.reason for stop in there.recovery.stops] == [StopReason.OPERATOR.text]
        there.lease.request("enable", axes=[0])
        assert there.run(300) == STOPPED
        assert there.arm.enabled.tolist() == [True, False]
        there.lease.request("enable", axes=[1])
        assert there.run(300) == RUNNING


def test_a_reason_after_the_stop_of_an_operator_enables_nothing() -> None:
    """The motion of the program goes on without the drives, which is its reason to stop."""
    with rig() as there:
        there.reader.stop()
        there.run(1)
        there.reason = lambda: "far from its path"
        there.run(20)
        there.reason = lambda: None
        assert there.run(2000) == STOPPED
        assert not there.arm.enabled.any()


def test_an_operator_stops_drives_that_wait_for_their_recovery() -> None:
    with rig() as there:
        there.reason = lambda: "key"
        there.run(50)
        assert not there.arm.enabled.any()
        there.reader.stop()
        there.run(5)
        there.reason = lambda: None
        assert there.run(2000) == STOPPED
        assert not there.arm.enabled.any()


def test_an_operator_enables_nothing_while_a_reason_holds() -> None:
    with rig() as there:
        there.reason = lambda: "key"
        there.run(50)
        there.lease.request("enable")
        there.run(100)
        assert there.recovery.phase == STOPPED
        assert not there.arm.enabled.any()
        there.reason = lambda: None
        assert there.run(500) == RUNNING


def test_a_fault_during_a_jog_is_recovered() -> None:
    with rig(drive_fault(0, at=0.5, for_=0.01)) as there:
        jog = there.lease.jog(0, 0.1)
        there.reason = lambda: "drive fault" if there.arm.faults else None
        for _ in range(400):
            if not jog.status.over:
                jog.beat()
            there.run(1)
        assert there.run(1500) == RUNNING
        assert jog.status.name == "ENDED_STOPPED"
        assert there.arm.actual.velocity == pytest.approx([0.0, 0.0], abs=1e-3)

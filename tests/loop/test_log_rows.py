"""The log of a loop: names, time, axes."""

from __future__ import annotations

import numpy as np
import pytest

import catenary as cat
from catenary.errors import DriveError
from catenary.log import Log
from catenary.virtual import Segment, Servo
from catenary.wire.cia402 import IN_FAULT


def drives(main: cat.MainDevice) -> cat.Drives:
    return cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)


def fail(loop: cat.Loop, servo: Servo) -> None:
    with loop:
        for cycle in loop:
            if cycle.number == 50:
                servo.inject_fault(0x8611)


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_time_is_that_of_the_cycle(execution: str) -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        with cat.Loop(drives(main), execution=execution) as loop:
            assert loop.log["time"][0] == 0.0  # from the first cycle, before the first iteration
            for cycle in loop:
                assert loop.log["time"][-1] == pytest.approx(cycle.time)
                if cycle.number == 20:
                    break
        time = loop.log["time"]
        assert time[0] < 0.0 < time[-1]
        assert np.diff(time) == pytest.approx(1e-3)


@pytest.mark.parametrize("execution", ["threaded", "inline"])
def test_axes_have_fields_of_their_own(execution: str) -> None:
    segment = Segment([Servo(name="shoulder"), Servo(name="elbow")])
    with cat.MainDevice(segment) as main:
        arm = drives(main)
        with cat.Loop(arm, execution=execution, log_axes=True) as loop:
            home = arm.actual.position.copy()
            for cycle in loop:
                arm.target.position[:] = home + np.array([0.01, -0.01]) * cycle.time
                if cycle.number == 100:
                    break
            log = loop.log
            assert log["elbow.actual.position"][-1] == arm.actual.position[1]
            assert log["elbow.state"][-1] == arm.state[1]
    assert log.axes == ("shoulder", "elbow")
    sent = log["shoulder.target.position"][-50:]
    assert np.diff(sent) == pytest.approx(1e-5)
    assert log["shoulder.commanded.position"][-50:] == pytest.approx(sent, abs=1e-5)


def test_axes_of_the_same_name_keep_their_positions() -> None:
    with cat.MainDevice(Segment([Servo(name="arm"), Servo(name="arm")])) as main:
        with cat.Loop(drives(main), log_axes=True) as loop:
            next(iter(loop))
        assert loop.log.axes == ("0 arm", "1 arm")


def test_an_error_has_the_same_log() -> None:
    servo = Servo(name="arm")
    with cat.MainDevice(Segment([servo])) as main:
        with pytest.raises(DriveError) as caught:
            fail(cat.Loop(drives(main), log_axes=True), servo)
        log = caught.value.log
    assert isinstance(log, Log)
    assert log["arm.state"][-1] in IN_FAULT


def test_without_it_there_are_no_axes() -> None:
    with cat.MainDevice(Segment([Servo()])) as main:
        with cat.Loop(drives(main)) as loop:
            next(iter(loop))
        assert loop.log.axes == ()
        assert loop.log.dtype.names is not None
        assert loop.log.dtype.names[0] == "time"

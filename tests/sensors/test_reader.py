from __future__ import annotations

import math
import os
import signal
import sys
import time
from subprocess import PIPE, Popen

import numpy as np
import pytest

import catenary as cat
from catenary import sensors
from catenary.errors import ShareError
from catenary.sensors import Channel, SensorShare
from catenary.virtual import Segment, Servo
from tests.share.names import own_name

CHANNELS = [Channel("force", "N", (3,)), Channel("status", dtype="<u4")]
GOOD = {"force": [1.0, 2.0, 3.0], "status": 7}
MS = 1_000_000
START = 1_000_000_000
OTHER = """
import sys, time
from catenary.sensors import Channel, SensorShare
channels = [Channel("force", "N", (3,)), Channel("status", dtype="<u4")]
with SensorShare(sys.argv[1], channels, 500.0) as share:
    share.publish({"force": [1, 2, 3], "status": 7}, 1_000_000_000)
    print("ready", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def share():
    with own_name("wrist") as name, SensorShare(name, CHANNELS, rate=500.0) as made:
        yield made


def test_a_fresh_sample_is_valid(share):
    share.publish(GOOD, START)
    with sensors.attach(share.name) as wrist:
        now = wrist.read(START + 5 * MS)
    assert now.valid
    assert now.reason == ""
    assert now["force"].tolist() == GOOD["force"]
    assert now.values["status"] == 7
    assert now.time_ns == START
    assert now.age == pytest.approx(5e-3)


def test_a_sample_older_than_three_periods_is_invalid_and_not_frozen(share):
    share.publish(GOOD, START)
    with sensors.attach(share.name) as wrist:
        now = wrist.read(START + 7 * MS)
    assert not now.valid
    assert now.reason == "the sample is too old"
    assert np.isnan(now["force"]).all()
    assert now["status"] == 0
    assert (now.rate, now.age) == (0.0, pytest.approx(7e-3))


def test_the_program_chooses_the_age(share):
    share.publish(GOOD, START)
    with sensors.attach(share.name, max_age=0.1) as wrist:
        assert wrist.read(START + 99 * MS).valid
        assert not wrist.read(START + 101 * MS).valid


def test_the_reason_is_that_of_the_sensor(share):
    with sensors.attach(share.name) as wrist:
        share.invalidate("no data", START)
        assert wrist.read(START).reason == "no data"
        share.publish(GOOD, START + MS, valid=False, reason="overload")
        now = wrist.read(START + MS)
    assert now.reason == "overload"
    assert not now.valid
    assert np.isnan(now["force"]).all()


def test_before_the_first_sample_there_is_none(share):
    with sensors.attach(share.name) as wrist:
        now = wrist.read()
    assert (now.valid, now.reason, now.age) == (False, "no sample yet", math.inf)
    assert np.isnan(now["force"]).all()


@pytest.mark.parametrize("kill", [False, True])
def test_the_end_of_the_program_is_seen_and_its_return_too(kill):
    with own_name("wrist") as name:
        process = Popen([sys.executable, "-c", OTHER, name], stdout=PIPE, text=True)
        try:
            assert process.stdout.readline() == "ready\n"
            with sensors.attach(name, max_age=1.0) as wrist:
                assert wrist.read(START).valid
                os.kill(process.pid, signal.SIGKILL if kill else signal.SIGINT)
                process.wait(10.0)
                old = wrist.read(START + 2000 * MS)
                assert old.reason == f"the program of the sensor has {wrist_state(kill)}"
                with SensorShare(name, CHANNELS, 500.0) as again:
                    again.publish(GOOD, time.monotonic_ns())
                    until = time.monotonic() + 20.0
                    while not wrist.read().valid and time.monotonic() < until:
                        again.publish(GOOD, time.monotonic_ns())
                    assert wrist.read().valid
        finally:
            process.kill()
            process.wait()
            process.stdout.close()


def test_without_an_age_limit_a_sensor_that_ended_is_invalid():
    with own_name("switch") as name:
        with SensorShare(name, CHANNELS, 1.0) as share:
            share.publish(GOOD, START)
            switch = sensors.attach(name, max_age=math.inf)
            assert switch.read(START + 1_000_000 * MS).valid
        with switch:
            now = switch.read(START + 1_000_001 * MS)
    assert now.reason == "the program of the sensor has ended"
    assert np.isnan(now["force"]).all()


def wrist_state(kill: bool) -> str:
    return "died" if kill else "ended"


def test_a_sensor_that_returns_with_other_channels_is_refused():
    with own_name("wrist") as name:
        with SensorShare(name, CHANNELS, 500.0) as first:
            first.publish(GOOD, START)
            wrist = sensors.attach(name)
        with SensorShare(name, CHANNELS[:1], 500.0), wrist:
            assert "other channels" in wrist.read().reason


def test_the_share_of_a_loop_is_not_a_sensor():
    with own_name("arm") as name, cat.MainDevice(Segment([Servo()])) as main:
        arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=1.0)
        with (
            cat.Share(name) as share,
            cat.Loop(arm, period=1e-3, sink=share),
            pytest.raises(ShareError, match="does not belong to a sensor"),
        ):
            sensors.attach(name)


@pytest.mark.parametrize("age", [0.0, -1.0, math.nan])
def test_an_age_must_be_positive(share, age):
    with pytest.raises(ValueError, match="must be positive"):
        sensors.attach(share.name, max_age=age)

"""An inertial sensor of MicroStrain at a serial port, from its bytes to a reader's program."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import catenary as cat
from catenary import sensors
from catenary.sensors.mip import Mip
from catenary.sensors.serial_port import SerialPort
from tests.sensors import mip_device as device
from tests.sensors.mip_serial import Device
from tests.share.names import own_name

pytest.importorskip("serial")

RATE = 500.0
PERIOD_NS = 2_000_000
LIMIT = 30.0  # [s] until a test fails; no result depends on it
LONG = sensors.Options(silence=LIMIT, reopen=LIMIT, pause=1e-3, pause_max=1e-3)
SHORT = sensors.Options(silence=0.05, reopen=0.1, pause=1e-3, pause_max=1e-3)


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < end, "the condition is never true"
        time.sleep(1e-3)


@dataclass
class Imu:
    """A sensor in a share, and the path at which its device appears."""

    port: str
    share: sensors.SensorShare
    sensor: Mip

    def run(self, options: sensors.Options) -> sensors.Task:
        return sensors.Task(self.sensor, SerialPort(self.port), self.share, options=options)

    def reasons(self) -> list[str]:
        """Return why the sensor was invalid, oldest first."""
        with cat.attach(self.share.name) as reader:
            return [each.message for each in reader.events()[0] if each.kind == "SensorInvalid"]

    def valid(self) -> list[int]:
        """Return the validity of all rows, oldest first."""
        with cat.attach(self.share.name) as reader:
            return reader.rows(0)[0]["valid"].tolist()


@pytest.fixture
def imu(tmp_path: Path) -> Iterator[Imu]:
    sensor = Mip(["acceleration", "angular_velocity"], rate=RATE)
    with own_name("imu") as name, sensors.SensorShare(name, sensor.channels, RATE) as share:
        yield Imu(str(tmp_path / "ttyIMU"), share, sensor)


def test_samples_reach_a_reader_in_si_units(imu: Imu) -> None:
    with Device(imu.port) as sent, imu.run(LONG):
        until(lambda: sent.streams)
        for number in range(20):
            sent.send(device.imu(number * PERIOD_NS, acceleration_g=1.0, rate=0.5))
        until(lambda: imu.sensor.counters.samples == 20)
        with sensors.attach(imu.share.name, max_age=LIMIT) as reader:
            until(lambda: reader.read().valid)
            now = reader.read()
    assert now["acceleration"].tolist() == pytest.approx([0.0, 0.0, 9.80665])
    assert now["angular_velocity"].tolist() == [0.5, 0.0, 0.0]
    assert (0x01, 0x02) in sent.commands  # set to idle
    assert sent.commands.index((0x0C, 0x0F)) < sent.commands.index((0x0C, 0x11))
    counters = imu.sensor.counters
    assert (counters.garbage, counters.bad_checksums, counters.lost) == (0, 0, 0)


def test_times_are_those_of_the_device_on_the_clock_of_this_machine(imu: Imu) -> None:
    """The packets arrive together, but their times keep the period of the device."""
    before_ns = time.monotonic_ns()
    with Device(imu.port) as sent, imu.run(LONG):
        until(lambda: sent.streams)
        sent.send(b"".join(device.imu(10**15 + number * PERIOD_NS) for number in range(5)))
        until(lambda: len(imu.valid()) >= 5)
        with cat.attach(imu.share.name) as reader:
            times = reader.rows(0)[0]["scheduled_ns"].tolist()
    assert times == sorted(times)
    assert before_ns <= times[0] <= times[-1] <= time.monotonic_ns()


def test_a_wrong_baud_rate_is_invalid_with_advice(imu: Imu) -> None:
    """At half the rate, two bits arrive as one: no sync bytes are left."""
    with Device(imu.port) as sent, imu.run(SHORT):
        until(lambda: sent.streams)
        while not imu.reasons():
            sent.send(bytes(byte & 0xCC for byte in device.imu(0)))
    assert "check the protocol and the baud rate" in imu.reasons()[0]
    assert imu.sensor.counters.garbage > 0
    assert not any(imu.valid())


def test_a_device_that_is_unplugged_and_returns(imu: Imu) -> None:
    with imu.run(LONG):
        until(lambda: any("cannot open" in reason for reason in imu.reasons()))
        for first in (0, 1000):  # the device restarts with another time
            with Device(imu.port) as sent:
                until(lambda sent=sent: sent.streams)
                sent.send(device.imu(first * PERIOD_NS))
                sent.send(device.imu((first + 1) * PERIOD_NS))
                until(lambda: imu.valid()[-2:] == [1, 1])
            until(lambda: imu.valid()[-1] == 0)
    assert any("lost the connection" in reason for reason in imu.reasons())
    assert imu.sensor.counters.reconnects >= 2
    assert imu.valid().count(1) == 4


def test_a_device_whose_time_goes_back(imu: Imu) -> None:
    with Device(imu.port) as sent, imu.run(LONG):
        until(lambda: sent.streams)
        for number in (100, 101, 3, 4):
            sent.send(device.imu(number * PERIOD_NS))
        until(lambda: len(imu.valid()) >= 4)
    assert imu.valid()[:4] == [1, 1, 0, 1]
    assert imu.sensor.counters.time_jumps == 1


def test_a_device_that_refuses_a_command(imu: Imu) -> None:
    with Device(imu.port) as sent, imu.run(LONG):
        until(lambda: sent.streams)
        sent.send(device.reply(0x0C, 0x0F, 3))
        until(lambda: bool(imu.reasons()))
    assert "refused the command message format" in imu.reasons()[0]

"""From a simulated RDT box by UDP to the program that reads the sensor."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from catenary import sensors
from catenary.sensors import Options, Rdt, SensorReader, SensorShare, Task, Udp
from tests.sensors.rdt_box import Box
from tests.share.names import own_name

START = (0x1234, 2, 0)
STOP = (0x1234, 0, 0)
PATIENT = Options(silence=0.3, reopen=0.6, pause=0.01, pause_max=0.02)


class Rig:
    def __init__(self, box: Box, decoder: Rdt, wrist: SensorReader) -> None:
        self.box, self.decoder, self.wrist = box, decoder, wrist

    def read(self, condition) -> sensors.Reading:
        """Return the first reading that meets a condition, within 20 s."""
        until = time.monotonic() + 20.0
        while not condition(now := self.wrist.read()):
            assert time.monotonic() < until, now
            self.wrist.wait(0.05)
        return now


@pytest.fixture
def rig() -> Iterator[Rig]:
    box, decoder = Box(), Rdt(500.0)
    with (
        own_name("wrist") as name,
        SensorShare(name, decoder.channels, decoder.rate) as share,
        Task(decoder, Udp("127.0.0.1", box.port), share, options=PATIENT),
        sensors.attach(name, max_age=60.0) as wrist,
    ):
        yield Rig(box, decoder, wrist)
    box.close()


def test_the_box_is_started_read_and_stopped():
    box, decoder = Box(), Rdt(500.0)
    with (
        own_name("wrist") as name,
        SensorShare(name, decoder.channels, decoder.rate) as share,
    ):
        with (
            Task(decoder, Udp("127.0.0.1", box.port), share, options=PATIENT),
            sensors.attach(name, max_age=60.0) as wrist,
        ):
            assert box.receive() == START
            box.send(force=2.5)
            assert wrist.wait(20.0)
            assert wrist.read()["force"].tolist() == [2.5, 0.0, 0.0]
        assert box.receive() == STOP
    box.close()


def test_gaps_and_reordered_records_are_counted(rig):
    rig.box.receive()
    for skip in (0, 0, 2, 0):  # 1 2 5 6
        rig.box.send(skip=skip)
    rig.box.send_record(4, force=9.0)  # late
    rig.box.send(force=7.0)
    rig.read(lambda now: now.valid and now["force"][0] == 7.0)
    counters = rig.decoder.counters
    assert (counters.lost, counters.reordered, counters.samples) == (2, 1, 5)


def test_garbage_is_counted_and_does_no_harm(rig):
    rig.box.receive()
    rig.box.send_bytes(b"\xff" * 37)
    rig.box.send(force=1.0)
    assert rig.read(lambda now: now.valid)["force"][0] == 1.0
    assert rig.decoder.counters.garbage == 37


def test_an_error_of_the_box_is_invalid_until_it_ends(rig):
    rig.box.receive()
    rig.box.send(status=0x80010000)
    assert "0x80010000" in rig.read(lambda now: now.time_ns).reason
    rig.box.send(force=3.0)
    assert rig.read(lambda now: now.valid)["force"][0] == 3.0


def test_a_box_that_restarts_is_started_again(rig):
    rig.box.receive()
    rig.box.send(force=1.0)
    rig.read(lambda now: now.valid)
    assert rig.read(lambda now: not now.valid).reason == "no data"
    assert rig.box.receive() == STOP
    assert rig.box.receive() == START  # the same box, which has forgotten the stream
    rig.box.send(force=2.0)
    assert rig.read(lambda now: now.valid)["force"][0] == 2.0
    assert rig.decoder.counters.silences == 1


def test_an_absent_box_is_awaited():
    absent = Box()
    absent.close()  # its port now refuses datagrams
    decoder = Rdt(500.0)
    with (
        own_name("wrist") as name,
        SensorShare(name, decoder.channels, decoder.rate) as share,
        Task(decoder, Udp("127.0.0.1", absent.port), share, options=PATIENT),
        sensors.attach(name) as wrist,
    ):
        until = time.monotonic() + 20.0
        while decoder.counters.reconnects < 2 and time.monotonic() < until:
            wrist.wait(0.1)
        assert "Connection refused" in wrist.read().reason

"""All devices' counters, and traffic to make them count."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import NoDeviceError, ResponseTimeout
from catenary.procedure.cable_traffic import exercise
from catenary.procedure.error_counters import clear_error_counters, read_error_counters
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.station import Station
from catenary.wire.error_counters import ErrorCounters, PortErrors
from tests.procedure.by_hand import play


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment([cat.virtual.Coupler(), *[cat.virtual.DigitalOutputs() for _ in range(39)]])


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_forty_devices_share_a_frame(segment: cat.Segment, main: cat.MainDevice) -> None:
    stations = [sub.station for sub in main.passive_scan(names=False)]
    segment.core.poke(3, 0x0302, b"\x05\x06")
    segment.core.poke(3, 0x0311, b"\x07")
    before = main.counts.sent
    found = main.converse(read_error_counters(stations))
    assert main.counts.sent - before == 1
    assert found[3] == ErrorCounters((PortErrors(), PortErrors(5, 6, 0, 7), *[PortErrors()] * 2))
    assert not any(found[:3] + found[4:])


def test_a_silent_device_is_none(segment: cat.Segment, main: cat.MainDevice) -> None:
    stations = [sub.station for sub in main.passive_scan(names=False)]
    segment.plug(devices=2)
    found = main.converse(read_error_counters(stations))
    assert found[1] is not None
    assert found[1].ports[1].lost_links == 1
    assert set(found[2:]) == {None}


def test_where_no_frame_comes_back_nobody_has_said_anything(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    stations = [sub.station for sub in main.passive_scan(names=False)]
    segment.unplug()
    assert set(main.converse(read_error_counters(stations))) == {None}


def test_a_frame_that_is_lost_is_no_silence() -> None:
    def answer(request: Request) -> Reply:
        return Reply(request.data, 1, lost=request.address & 0xFFFF == 0x1002)

    stations = [Station(0, 0x1001), Station(1, 0x1002)]
    with pytest.raises(ResponseTimeout, match="device 1: error counters: the frame did not come"):
        play(read_error_counters(stations), answer)


def test_nobody_to_ask(main: cat.MainDevice) -> None:
    assert main.converse(read_error_counters([])) == ()


def test_all_counters_are_cleared(segment: cat.Segment, main: cat.MainDevice) -> None:
    stations = [sub.station for sub in main.passive_scan(names=False)]
    segment.core.poke(1, 0x0300, bytes(range(1, 15)))
    segment.core.poke(1, 0x0310, b"\x01\x02\x03\x04")
    main.converse(clear_error_counters(stations))
    assert main.converse(read_error_counters(stations))[1] == ErrorCounters()


def test_exercise_lasts_as_long_as_asked(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.passive_scan(names=False)
    start = segment.now_ns
    sent, lost = main.converse(exercise(0.5))
    assert 0.5 <= (segment.now_ns - start) * 1e-9 < 0.51
    assert 400 < sent < 500
    assert lost == 0


def test_exercise_ends_where_the_segment_is_gone(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    main.passive_scan(names=False)
    segment.unplug()
    with pytest.raises(NoDeviceError, match=r"the last 50 of \d+ frames were lost"):
        main.converse(exercise(1e6))

"""Error counters of all devices."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import ResponseTimeout
from catenary.procedure.error_counters import clear_error_counters, read_error_counters
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.station import Station
from catenary.wire.error_counters import ErrorCounters, PortErrors
from tests.procedure.player import play


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


def test_the_counts_of_a_silent_device_are_none(segment: cat.Segment, main: cat.MainDevice) -> None:
    stations = [sub.station for sub in main.passive_scan(names=False)]
    segment.plug(devices=2)
    found = main.converse(read_error_counters(stations))
    assert found[1] is not None
    assert found[1].ports[1].lost_links == 1
    assert set(found[2:]) == {None}


def test_without_any_reply_all_counts_are_none(segment: cat.Segment, main: cat.MainDevice) -> None:
    stations = [sub.station for sub in main.passive_scan(names=False)]
    segment.unplug()
    assert set(main.converse(read_error_counters(stations))) == {None}


def test_a_lost_frame_is_an_error() -> None:
    def answer(request: Request) -> Reply:
        return Reply(request.data, 1, lost=request.address & 0xFFFF == 0x1002)

    stations = [Station(0, 0x1001), Station(1, 0x1002)]
    with pytest.raises(ResponseTimeout, match="device 1: error counters: the frame did not come"):
        play(read_error_counters(stations), answer)


def test_no_devices(main: cat.MainDevice) -> None:
    assert main.converse(read_error_counters([])) == ()


def test_all_counters_are_cleared(segment: cat.Segment, main: cat.MainDevice) -> None:
    stations = [sub.station for sub in main.passive_scan(names=False)]
    segment.core.poke(1, 0x0300, bytes(range(1, 15)))
    segment.core.poke(1, 0x0310, b"\x01\x02\x03\x04")
    main.converse(clear_error_counters(stations))
    assert main.converse(read_error_counters(stations))[1] == ErrorCounters()

"""Test traffic on cables."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import NoDeviceError
from catenary.procedure.cable_traffic import exercise


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment([cat.virtual.Coupler(), cat.virtual.DigitalOutputs()])


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_traffic_lasts_for_the_given_time(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.passive_scan(names=False)
    start = segment.now_ns
    sent, lost = main.converse(exercise(0.5))
    assert 0.5 <= (segment.now_ns - start) * 1e-9 < 0.51
    assert 400 < sent < 500
    assert lost == 0


def test_traffic_ends_if_the_segment_is_lost(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.passive_scan(names=False)
    segment.unplug()
    with pytest.raises(NoDeviceError, match=r"the last 50 of \d+ frames were lost"):
        main.converse(exercise(1e6))

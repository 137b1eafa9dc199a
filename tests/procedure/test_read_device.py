"""Passive scan: only missing or duplicate station addresses are written."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.procedure.read_device import distinct, visit
from catenary.procedure.stations import STATION_BASE
from catenary.wire.al import AlState


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ((1, 2, 3), (1, 2, 3)),
        ((0, 0), (STATION_BASE, STATION_BASE + 1)),
        ((7, 7, 9), (7, STATION_BASE + 1, 9)),
        ((STATION_BASE + 1, 0, 0), (STATION_BASE + 1, STATION_BASE + 2, STATION_BASE + 3)),
        ((0, STATION_BASE), (STATION_BASE + 1, STATION_BASE)),
    ],
)
def test_unique_addresses_are_kept(found: tuple[int, ...], expected: tuple[int, ...]) -> None:
    assert distinct(found) == expected


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.DigitalOutputs()])


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_a_visit_keeps_addresses_and_states(segment: cat.Segment, main: cat.MainDevice) -> None:
    main.scan()
    for position in range(3):
        segment.core.poke(position, 0x0010, bytes((0x50 + position, 0)))
    found = main.converse(visit(3))
    assert [each.station_address for each in found] == [0x50, 0x51, 0x52]
    assert [segment.core.peek(n, 0x0130, 1)[0] for n in range(3)] == [AlState.PRE_OP] * 3


def test_a_visit_to_devices_after_power_up(segment: cat.Segment, main: cat.MainDevice) -> None:
    found = main.converse(visit(3))
    assert [each.station_address for each in found] == [STATION_BASE + n for n in range(3)]
    assert found[1].dl_status == int.from_bytes(segment.core.peek(1, 0x0110, 2), "little")

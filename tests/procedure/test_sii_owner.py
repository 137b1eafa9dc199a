"""Ownership of the EEPROM: the MainDevice or the device's processor."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import EepromError
from catenary.procedure.alias import read_alias, write_alias
from catenary.procedure.sii_owner import with_eeprom


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(alias=3)])


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_the_eeprom_is_returned_to_the_processor(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    station = main.passive_scan(names=False)[1].station
    segment.core.poke(1, 0x0500, b"\x01")
    main.converse(with_eeprom(station, write_alias(station, 9)))
    assert segment.core.peek(1, 0x0500, 1) == b"\x01"
    assert main.passive_scan()[1].name == "Catenary virtual servo"
    assert segment.core.peek(1, 0x0500, 1) == b"\x01"


def test_an_eeprom_in_use_by_the_processor_is_refused(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    station = main.passive_scan(names=False)[1].station
    segment.core.poke(1, 0x0500, b"\x01\x01")
    with pytest.raises(EepromError, match="its processor is using the EEPROM"):
        main.converse(with_eeprom(station, read_alias(station)))
    found = main.passive_scan()[1]
    assert found.description.notes[0].endswith("is using the EEPROM (register 0x0501)")

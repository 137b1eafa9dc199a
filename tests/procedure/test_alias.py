"""Station aliases in the EEPROM."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import EepromError
from catenary.procedure.alias import read_alias, write_alias
from catenary.procedure.sii_write import Change, write_word
from catenary.wire.sii import CHECKSUM_WORD, decode_sii


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(alias=3)])


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_an_alias_is_written_with_the_checksum(segment: cat.Segment, main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    assert main.converse(read_alias(station)) == 3
    main.converse(write_alias(station, 0x1234))
    assert main.converse(read_alias(station)) == 0x1234
    assert decode_sii(segment.core.sii_image(1)).header.station_alias == 0x1234


def test_an_alias_is_refused_if_the_checksum_is_wrong(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    station = main.passive_scan(names=False)[1].station
    main.converse(write_word(station, Change(CHECKSUM_WORD, 0)))
    with pytest.raises(EepromError, match="may be damaged"):
        main.converse(write_alias(station, 5))

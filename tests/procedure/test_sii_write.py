"""Words written into an EEPROM, and EEPROMs that do not take them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import EepromError
from catenary.procedure.alias import read_alias, write_alias
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.sii_owner import with_eeprom
from catenary.procedure.sii_write import Change, changes, write_word, write_words
from catenary.wire.sii import CHECKSUM_WORD, decode_sii
from tests.procedure.by_hand import STATION, play

MS = 1_000_000


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment(
        [cat.virtual.Coupler(), cat.virtual.Servo(alias=3), cat.virtual.DigitalOutputs()]
    )


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_only_what_differs_is_written_and_the_checksum_last() -> None:
    old, new = bytearray(256), bytearray(256)
    new[14], new[8], new[200] = 0x11, 0x22, 0x33
    assert changes(old, bytes(new)) == (Change(100, 0x33), Change(4, 0x22), Change(7, 0x11))
    assert changes(old, bytes(old)) == ()


def test_images_of_different_lengths_are_not_compared() -> None:
    with pytest.raises(ValueError, match="256 and 254"):
        changes(bytes(256), bytes(254))


def test_words_arrive_in_the_eeprom(segment: cat.Segment, main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    main.converse(write_words(station, [Change(0x20, 0xBEEF), Change(0x21, 0x0001)]))
    assert segment.core.sii_image(1)[0x40:0x44] == b"\xef\xbe\x01\x00"


def test_a_slow_eeprom_is_waited_for(segment: cat.Segment, main: cat.MainDevice) -> None:
    segment.core.time_sii(1, 2 * MS, 100 * MS, False)
    station = main.passive_scan(names=False)[1].station
    main.converse(write_word(station, Change(0x20, 0x1234)))
    assert segment.core.sii_image(1)[0x40:0x42] == b"\x34\x12"


def test_an_eeprom_that_stays_busy_has_an_end(segment: cat.Segment, main: cat.MainDevice) -> None:
    segment.core.time_sii(1, 2 * MS, 2000 * MS, False)
    station = main.passive_scan(names=False)[1].station
    with pytest.raises(EepromError, match=r"busy with word 0x0020 for 0\.5 s"):
        main.converse(write_word(station, Change(0x20, 0x1234)))


def test_past_the_end_it_does_not_acknowledge(main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    with pytest.raises(EepromError, match="does not acknowledge"):
        main.converse(write_word(station, Change(0x8000, 1)))


def test_a_write_protected_eeprom_reads_back_the_old_word() -> None:
    def protected(request: Request) -> Reply:
        """Takes every command, writes nothing; every word reads 0xFFFF."""
        return Reply(b"\x00\x00" + bytes(4) + b"\xff" * 8, 1)._replace(
            data=(bytes(6) + b"\xff" * 8)[: len(request.data)]
        )

    with pytest.raises(EepromError, match="the value read back is 0xFFFF"):
        play(write_word(STATION, Change(0x20, 0x1234)), protected)


def test_an_alias_comes_with_its_checksum(segment: cat.Segment, main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    assert main.converse(read_alias(station)) == 3
    main.converse(write_alias(station, 0x1234))
    assert main.converse(read_alias(station)) == 0x1234
    assert decode_sii(segment.core.sii_image(1)).header.station_alias == 0x1234


def test_an_alias_does_not_bless_an_eeprom_with_a_wrong_checksum(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    station = main.passive_scan(names=False)[1].station
    main.converse(write_word(station, Change(CHECKSUM_WORD, 0)))
    with pytest.raises(EepromError, match="may be damaged"):
        main.converse(write_alias(station, 5))


def test_the_eeprom_goes_back_to_the_processor_it_was_taken_from(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    station = main.passive_scan(names=False)[1].station
    segment.core.poke(1, 0x0500, b"\x01")
    main.converse(with_eeprom(station, write_alias(station, 9)))
    assert segment.core.peek(1, 0x0500, 1) == b"\x01"
    assert main.passive_scan()[1].name == "Catenary virtual servo"
    assert segment.core.peek(1, 0x0500, 1) == b"\x01"


def test_an_eeprom_in_use_by_the_processor_is_left_to_it(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    station = main.passive_scan(names=False)[1].station
    segment.core.poke(1, 0x0500, b"\x01\x01")
    with pytest.raises(EepromError, match="its processor is using the EEPROM"):
        main.converse(with_eeprom(station, read_alias(station)))
    found = main.passive_scan()[1]
    assert found.description.notes[0].endswith("is using the EEPROM (register 0x0501)")

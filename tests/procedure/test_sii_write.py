"""Write access to EEPROMs, and refusals."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import EepromError
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.sii_write import Change, changes, write_word, write_words
from tests.procedure.player import STATION, play

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


def test_only_differences_are_written_and_the_checksum_last() -> None:
    old, new = bytearray(256), bytearray(256)
    new[14], new[8], new[200] = 0x11, 0x22, 0x33
    assert changes(old, bytes(new)) == (Change(100, 0x33), Change(4, 0x22), Change(7, 0x11))
    assert changes(old, bytes(old)) == ()


def test_images_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="256 and 254"):
        changes(bytes(256), bytes(254))


def test_words_are_written_to_the_eeprom(segment: cat.Segment, main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    main.converse(write_words(station, [Change(0x20, 0xBEEF), Change(0x21, 0x0001)]))
    assert segment.core.sii_image(1)[0x40:0x44] == b"\xef\xbe\x01\x00"


def test_a_slow_eeprom_is_polled_until_it_is_ready(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    segment.core.time_sii(1, 2 * MS, 100 * MS, False)
    station = main.passive_scan(names=False)[1].station
    main.converse(write_word(station, Change(0x20, 0x1234)))
    assert segment.core.sii_image(1)[0x40:0x42] == b"\x34\x12"


def test_a_write_to_a_busy_eeprom_times_out(segment: cat.Segment, main: cat.MainDevice) -> None:
    segment.core.time_sii(1, 2 * MS, 2000 * MS, False)
    station = main.passive_scan(names=False)[1].station
    with pytest.raises(EepromError, match=r"busy with word 0x0020 for 0\.5 s"):
        main.converse(write_word(station, Change(0x20, 0x1234)))


def test_a_write_beyond_the_end_is_not_acknowledged(main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    with pytest.raises(EepromError, match="does not acknowledge"):
        main.converse(write_word(station, Change(0x8000, 1)))


def test_a_write_protected_eeprom_reads_back_the_old_word() -> None:
    def protected(request: Request) -> Reply:
        """Accept every command but write nothing. Every word reads 0xFFFF."""
        return Reply(b"\x00\x00" + bytes(4) + b"\xff" * 8, 1)._replace(
            data=(bytes(6) + b"\xff" * 8)[: len(request.data)]
        )

    with pytest.raises(EepromError, match="the value read back is 0xFFFF"):
        play(write_word(STATION, Change(0x20, 0x1234)), protected)

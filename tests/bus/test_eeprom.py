"""Reading and writing of whole EEPROMs, and interrupted writes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.bus.eeprom import aftermath, read_eeprom, write_eeprom
from catenary.errors import EepromError
from catenary.procedure.sii_write import Change, changes


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo(), cat.virtual.DigitalOutputs()])


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_all_bytes_are_read(segment: cat.Segment, main: cat.MainDevice) -> None:
    seen: list[tuple[int, int]] = []
    station = main.passive_scan(names=False)[1].station
    image = read_eeprom(main, station, 2048, progress=lambda *far: seen.append(far))
    assert image == segment.core.sii_image(1)
    assert seen == [(256, 1024), (512, 1024), (768, 1024), (1024, 1024)]


def test_another_image_is_written(segment: cat.Segment, main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    old, new = segment.core.sii_image(1), segment.core.sii_image(2)
    write_eeprom(main, station, changes(old, new))
    assert segment.core.sii_image(1) == new


def test_an_interrupted_write_reports_the_state_of_the_device(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    station = main.passive_scan(names=False)[1].station
    wanted = changes(segment.core.sii_image(1), segment.core.sii_image(2))

    def pull_the_cable(done: int, total: int) -> None:
        if done == 32:
            segment.plug(devices=1)

    with pytest.raises(EepromError) as caught:
        write_eeprom(main, station, wanted, progress=pull_the_cable)
    assert f"32 of {len(wanted)} words are written" in caught.value.message
    assert "mixture of old and new" in caught.value.message
    assert caught.value.hint.endswith("Write the same file again when that is done")
    segment.plug()
    written = changes(segment.core.sii_image(1), segment.core.sii_image(2))
    assert wanted[32:] == written


CATEGORY, PDI, CHECKSUM = Change(0x50, 1), Change(0, 2), Change(7, 3)


@pytest.mark.parametrize(
    ("done", "begun", "text"),
    [
        (0, 1, "0 of 3 words are written, perhaps a few more"),
        (0, 1, "mixture of old and new"),
        (1, 2, "may not load its configuration"),
        (2, 3, "may not load its configuration"),
    ],
)
def test_aftermath(done: int, begun: int, text: str) -> None:
    assert text in aftermath([CATEGORY, PDI, CHECKSUM], done, begun)

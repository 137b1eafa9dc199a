"""Access to the memory of a device, and refusals."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import catenary as cat
from catenary.errors import RegisterError, ResponseTimeout
from catenary.procedure.registers import read_register, write_register


@pytest.fixture
def segment() -> cat.Segment:
    return cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo()])


@pytest.fixture
def main(segment: cat.Segment) -> Iterator[cat.MainDevice]:
    with cat.MainDevice(segment) as main:
        yield main


def test_written_bytes_are_read_back(main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    main.converse(write_register(station, 0x0400, b"\x34\x12"))
    assert main.converse(read_register(station, 0x0400, 2)) == b"\x34\x12"


def test_a_read_only_register_is_distinguished_from_a_silent_device(
    segment: cat.Segment, main: cat.MainDevice
) -> None:
    station = main.passive_scan(names=False)[1].station
    with pytest.raises(RegisterError, match="0x0130 to 0x0131 cannot be written"):
        main.converse(write_register(station, 0x0130, b"\x08\x00"))
    segment.plug(devices=1)
    with pytest.raises(ResponseTimeout, match="no answer"):
        main.converse(write_register(station, 0x0130, b"\x08\x00"))


def test_an_address_beyond_the_memory_is_an_error(main: cat.MainDevice) -> None:
    station = main.passive_scan(names=False)[1].station
    with pytest.raises(RegisterError, match="0xFFFF cannot be read"):
        main.converse(read_register(station, 0xFFFF, 1))

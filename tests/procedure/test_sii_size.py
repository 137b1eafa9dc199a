"""Size of an EEPROM, also with faulty images."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

import catenary as cat
from catenary.procedure.exchange import Reply, Request
from catenary.procedure.sii_size import Extent, read_extent
from catenary.wire.sii import MAXIMUM_SIZE, Header
from tests.procedure.player import STATION, play


def eeprom(image: bytes, *, two_byte_address: bool = False) -> Callable[[Request], Reply]:
    """Return a controller with an EEPROM that is always ready. Reads wrap around at its end."""
    address = 0

    def answer(request: Request) -> Reply:
        nonlocal address
        if any(request.data):
            address = int.from_bytes(request.data[2:6], "little")
            return Reply(request.data, 1)
        start = 2 * address % len(image)
        words = (image + image)[start : start + 8]
        status = (0x40 | 0x80 * two_byte_address).to_bytes(2, "little")
        return Reply((status + bytes(4) + words)[: len(request.data)], 1)

    return answer


def header(size_kbit: int) -> bytes:
    return Header(vendor=2, product=3, revision=4, size_kbit=size_kbit).encode()


@pytest.fixture
def main() -> Iterator[cat.MainDevice]:
    with cat.MainDevice(cat.Segment([cat.virtual.Coupler(), cat.virtual.Servo()])) as main:
        yield main


def test_size_in_the_header(main: cat.MainDevice) -> None:
    assert main.converse(read_extent(main.passive_scan()[1].station)) == Extent(2048, MAXIMUM_SIZE)


def test_a_size_beyond_the_address_range_is_limited() -> None:
    extent = play(read_extent(STATION), eeprom(header(64) + b"\xff" * 1920))
    assert (extent.size, extent.limit) == (2048, 2048)
    assert "its header specifies 8192 bytes" in extent.note


def test_an_emulated_eeprom_does_not_wrap() -> None:
    extent = play(read_extent(STATION), eeprom(header(64) + b"\xff" * (8192 - 128)))
    assert extent == Extent(8192, MAXIMUM_SIZE)


def test_two_address_bytes_extend_the_range() -> None:
    image = header(64) + b"\xff" * 1920
    assert play(read_extent(STATION), eeprom(image, two_byte_address=True)).size == 8192


def test_with_a_wrong_checksum_the_end_mark_gives_the_size() -> None:
    image = bytearray(header(16) + b"\x0a\x00\x02\x00abcd" + b"\xff" * 1912)
    image[14] ^= 1
    extent = play(read_extent(STATION), eeprom(bytes(image)))
    assert extent.size == 128 + 8 + 2
    assert "checksum" in extent.note


@pytest.mark.parametrize("two", [False, True])
def test_an_unprogrammed_eeprom_ends(two: bool) -> None:
    extent = play(read_extent(STATION), eeprom(bytes(2048), two_byte_address=two), steps=1000)
    assert extent.size == (4096 if two else 2048)
    assert "no end mark" in extent.note

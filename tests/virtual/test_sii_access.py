"""EEPROM access through registers: reads of 4 and 8 bytes, writes, busy flag and errors."""

from __future__ import annotations

import struct

import pytest

from catenary.virtual import Coupler, Segment
from catenary.virtual.description import VENDOR_ID
from tests.virtual.main_device import SII_CONTROL, SII_DATA, STATION, MainDevice

BUSY = 0x8000


@pytest.fixture
def main() -> MainDevice:
    main = MainDevice(Segment([Coupler(serial=0x1234)]))
    main.number_stations()
    return main


def command(main: MainDevice, control: int, address: int) -> int:
    """Execute a command and return the control word after its end."""
    assert main.write(STATION, SII_CONTROL, struct.pack("<HI", control, address)) == 1
    assert struct.unpack("<H", main.read(STATION, SII_CONTROL, 2))[0] & BUSY
    main.let_pass(5)
    return int(struct.unpack("<H", main.read(STATION, SII_CONTROL, 2))[0])


def test_read_takes_time_and_returns_four_bytes(main: MainDevice) -> None:
    assert command(main, 0x0100, 8) & 0xF800 == 0
    assert struct.unpack("<I", main.read(STATION, SII_DATA, 4))[0] == VENDOR_ID


def test_read_returns_eight_bytes_with_the_feature_bit(main: MainDevice) -> None:
    main.segment.core.time_sii(0, 100_000, 100_000, True)
    assert command(main, 0x0100, 12) & 0x0040
    revision = Coupler().description().revision
    assert struct.unpack("<II", main.read(STATION, SII_DATA, 8)) == (revision, 0x1234)


def test_busy_interface_accepts_no_commands(main: MainDevice) -> None:
    main.write(STATION, SII_CONTROL, struct.pack("<HI", 0x0100, 8))
    assert main.write(STATION, SII_CONTROL, struct.pack("<HI", 0x0100, 10)) == 0
    main.let_pass(1)
    assert struct.unpack("<I", main.read(STATION, SII_DATA, 4))[0] == VENDOR_ID


def test_write_across_the_registers_does_not_restart_a_command(main: MainDevice) -> None:
    main.segment.core.time_sii(0, 1_000_000, 1_000_000, False)
    main.write(STATION, SII_CONTROL, struct.pack("<HI", 0x0100, 8))
    main.let_pass(0.9)
    assert main.write(STATION, SII_CONTROL - 2, bytes(16)) == 1  # only the owner can be written
    main.let_pass(0.2)
    assert main.read(STATION, SII_CONTROL, 2) == b"\x80\x00"
    assert struct.unpack("<I", main.read(STATION, SII_DATA, 4))[0] == VENDOR_ID


def write_word(main: MainDevice, address: int, word: int, control: int = 0x0201) -> int:
    main.write(STATION, SII_DATA, struct.pack("<H", word))
    assert main.write(STATION, SII_CONTROL, struct.pack("<HI", control, address)) == 1
    main.let_pass(5)
    return int(struct.unpack("<H", main.read(STATION, SII_CONTROL, 2))[0])


def test_write_changes_one_word(main: MainDevice) -> None:
    assert write_word(main, 4, 0xBEEF) & 0xF800 == 0
    command(main, 0x0100, 4)
    assert main.read(STATION, SII_DATA, 2) == b"\xef\xbe"


def test_write_without_the_enable_bit_is_an_error(main: MainDevice) -> None:
    before = main.segment.core.sii_image(0)
    assert write_word(main, 4, 0xBEEF, control=0x0200) & 0x4000
    assert main.segment.core.sii_image(0) == before


def test_reload_detects_a_wrong_checksum_and_keeps_the_alias(main: MainDevice) -> None:
    write_word(main, 4, 0x0007)
    assert command(main, 0x0400, 0) & 0x0800
    assert main.read(STATION, 0x0012, 2) == b"\x00\x00"


def test_access_beyond_the_eeprom(main: MainDevice) -> None:
    command(main, 0x0100, 0x10000)
    assert main.read(STATION, SII_DATA, 4) == b"\xff\xff\xff\xff"
    assert write_word(main, 0x10000, 1) & 0x2000


def test_two_commands_at_once_are_an_error(main: MainDevice) -> None:
    main.write(STATION, SII_CONTROL, struct.pack("<HI", 0x0300, 0))
    assert struct.unpack("<H", main.read(STATION, SII_CONTROL, 2))[0] & 0x2000


def test_maindevice_has_no_access_while_the_pdi_is_owner(main: MainDevice) -> None:
    main.write(STATION, 0x0500, b"\x01")
    assert main.write(STATION, SII_CONTROL, struct.pack("<HI", 0x0100, 8)) == 0
    main.write(STATION, 0x0500, b"\x02")
    main.write(STATION, 0x0500, b"\x00")
    assert main.write(STATION, SII_CONTROL, struct.pack("<HI", 0x0100, 8)) == 1

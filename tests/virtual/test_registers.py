"""Addressing, working counters and write protection, command by command."""

from __future__ import annotations

import struct

import pytest

from catenary.virtual import Coupler, DigitalInputs, DigitalOutputs, Segment
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.virtual.main_device import STATION, MainDevice

USER_RAM = 0x0F80  # user RAM, which every controller has


@pytest.fixture
def main() -> MainDevice:
    main = MainDevice(Segment([Coupler(), DigitalOutputs(), DigitalInputs()]))
    main.number_stations()
    return main


@pytest.mark.parametrize(
    ("command", "adp", "expected"),
    [
        (EcatCommand.NOP, 0, 0),
        (EcatCommand.APRD, -1, 1),
        (EcatCommand.APWR, -1, 1),
        (EcatCommand.APRW, -1, 3),
        (EcatCommand.APRD, -3, 0),
        (EcatCommand.FPRD, STATION + 2, 1),
        (EcatCommand.FPWR, STATION + 2, 1),
        (EcatCommand.FPRW, STATION + 2, 3),
        (EcatCommand.FPRD, 0x2222, 0),
        (EcatCommand.BRD, 0, 3),
        (EcatCommand.BWR, 0, 3),
        (EcatCommand.BRW, 0, 9),
        (EcatCommand.ARMW, -1, 3),
        (EcatCommand.FRMW, STATION, 3),
    ],
)
def test_working_counter_of(
    main: MainDevice, command: EcatCommand, adp: int, expected: int
) -> None:
    assert main.exchange(command, adp, USER_RAM, b"\x5a\xa5").working_counter == expected


@pytest.mark.parametrize("command", [EcatCommand.LRD, EcatCommand.LWR, EcatCommand.LRW])
def test_logical_commands_without_a_mapping_are_not_counted(
    main: MainDevice, command: EcatCommand
) -> None:
    assert main.exchange_logical(command, 0, bytes(4)).working_counter == 0


def test_positions_and_broadcasts_count_the_devices_in_the_address(main: MainDevice) -> None:
    assert main.exchange(EcatCommand.BRD, 0, 0, b"\0").address & 0xFFFF == 3
    assert main.exchange(EcatCommand.APRD, -1, 0, b"\0").address & 0xFFFF == 2
    assert main.exchange(EcatCommand.FPRD, STATION, 0, b"\0").address & 0xFFFF == STATION


def test_broadcast_reads_are_combined_with_or(main: MainDevice) -> None:
    for k in range(3):
        main.write(STATION + k, USER_RAM, bytes([1 << k]))
    assert main.exchange(EcatCommand.BRD, 0, USER_RAM, b"\x80").data == b"\x87"


def test_read_write_returns_the_previous_value(main: MainDevice) -> None:
    main.write(STATION, USER_RAM, b"\x11")
    assert main.exchange(EcatCommand.FPRW, STATION, USER_RAM, b"\x22").data == b"\x11"
    assert main.read(STATION, USER_RAM, 1) == b"\x22"


def test_read_multiple_write_distributes_one_value(main: MainDevice) -> None:
    main.write(STATION + 1, USER_RAM, b"\x77")
    main.exchange(EcatCommand.FRMW, STATION + 1, USER_RAM, b"\x01")
    values = [main.read(STATION + k, USER_RAM, 1) for k in range(3)]
    assert values == [b"\x01", b"\x77", b"\x77"]


def test_write_to_read_only_registers_has_no_effect(main: MainDevice) -> None:
    before = main.read(STATION, 0x0000, 16)
    assert main.write(STATION, 0x0000, b"\xff" * 16) == 0
    assert main.read(STATION, 0x0000, 16) == before
    assert main.write(STATION, 0x0130, b"\x08\x00") == 0
    assert main.al_status(STATION)[0] == 1


def test_mixed_write_changes_only_the_writable_part(main: MainDevice) -> None:
    assert main.write(STATION, 0x000E, b"\xee\xee\x34\x12\xee\xee") == 1
    assert main.read(0x1234, 0x000E, 6) == b"\x00\x00\x34\x12\x00\x00"


def test_alias_is_used_only_when_enabled() -> None:
    main = MainDevice(Segment([Coupler(), Coupler(alias=77)]))
    main.number_stations()
    assert main.exchange(EcatCommand.FPRD, 77, 0x0012, bytes(2)).working_counter == 0
    main.write(STATION + 1, 0x0103, b"\x01")
    assert main.exchange(EcatCommand.FPRD, 77, 0x0012, bytes(2)) == (b"\x4d\x00", 1, 0x0012_004D)
    assert main.write(STATION + 1, 0x0012, b"\x05\x00") == 0


def test_access_beyond_the_memory_is_refused(main: MainDevice) -> None:
    assert main.exchange(EcatCommand.FPRD, STATION, 0xFFF0, bytes(64)).working_counter == 0
    assert main.exchange(EcatCommand.FPWR, STATION, 0x3000, bytes(64)).working_counter == 0
    assert main.exchange(EcatCommand.FPRD, STATION, 0x2FF0, bytes(64)).working_counter == 1


def test_dl_status_shows_the_end_of_the_line(main: MainDevice) -> None:
    inner, last = (main.read(STATION + k, 0x0110, 2) for k in (1, 2))
    assert struct.unpack("<H", inner)[0] & 0xFFF0 == 0x5A30
    assert struct.unpack("<H", last)[0] & 0xFFF0 == 0x5610


def test_cut_line_answers_up_to_the_cut(main: MainDevice) -> None:
    main.segment.plug(devices=2)
    assert main.exchange(EcatCommand.BRD, 0, 0x0000, b"\0").working_counter == 2
    assert main.read(STATION + 1, 0x0111, 1) == b"\x56"
    main.segment.unplug()
    main.link.send(encode_frame([Datagram(EcatCommand.BRD, 0, b"\0")]))
    assert not main.link.wait_until(main.link.now() + 1_000_000, True)
    assert main.segment.frames.lost == 1


def test_write_clears_a_group_of_error_counters(main: MainDevice) -> None:
    main.segment[0].count_errors(1, invalid_frames=300, lost_links=2)
    assert main.read(STATION, 0x0302, 1) == b"\xff"
    main.write(STATION, 0x0300, b"\x00")
    assert main.read(STATION, 0x0302, 1) == b"\x00"
    assert main.read(STATION, 0x0311, 1) == b"\x02"


def test_interrupt_field_contains_enabled_events(main: MainDevice) -> None:
    main.write(STATION, 0x0200, struct.pack("<H", 0x0008))
    main.write(STATION, 0x0120, b"\x02\x00")
    main.link.send(encode_frame([Datagram(EcatCommand.NOP, 0, b"\0")] * 2))
    frame = encode_frame([Datagram(EcatCommand.APRD, 0, bytes(2))])
    returned = main.segment.core.pass_frame(frame)
    assert returned is not None
    assert decode_frame(returned).datagrams[0].interrupt == 0x0008
    main.link.wait_until(main.link.now() + 1_000_000, True)
    main.link.receive()
    main.al_status(STATION)
    returned = main.segment.core.pass_frame(frame)
    assert returned is not None
    assert decode_frame(returned).datagrams[0].interrupt == 0


def test_processed_frames_have_the_local_address_bit() -> None:
    segment = Segment([Coupler()])
    frame = encode_frame([Datagram(EcatCommand.NOP, 0, b"")])
    returned = segment.core.pass_frame(frame)
    assert returned is not None
    assert returned[6] == frame[6] | 0x02


def test_descriptor_registers(main: MainDevice) -> None:
    kind, _revision, _build, fmmus, managers, ram, ports, features = struct.unpack(
        "<BBHBBBBH", main.read(STATION, 0x0000, 10)
    )
    assert (kind, fmmus, managers, ram, ports) == (0x11, 8, 8, 8, 0x0F)
    assert features & 0x000C == 0x000C  # clocks, 64 bits
    assert struct.unpack("<H", main.read(STATION + 1, 0x0008, 2))[0] == 0

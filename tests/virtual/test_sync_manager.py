"""SyncManagers: handshake, partial access, repeat, three buffers and access rights."""

from __future__ import annotations

import struct

import pytest

from catenary.virtual import DigitalInputs, DigitalOutputs, Segment, Servo
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import STATION, MainDevice

SERVO = STATION
IDENTITY = struct.pack("<HBHB4x", 0x2000, 0x40, 0x1018, 1)
FULL = 0x08


@pytest.fixture
def main() -> MainDevice:
    main = MainDevice(Segment([Servo()]))
    main.number_stations()
    main.start_mailbox(SERVO)
    return main


def test_full_mailbox_refuses_a_second_request(main: MainDevice) -> None:
    assert main.put(SERVO, IDENTITY) == 1
    assert main.read(SERVO, 0x0805, 1)[0] & FULL
    assert main.put(SERVO, IDENTITY) == 0
    assert main.fetch(SERVO) is not None
    assert main.fetch(SERVO) is None


def test_read_empties_the_mailbox(main: MainDevice) -> None:
    assert main.exchange(EcatCommand.FPRD, SERVO, 0x1080, bytes(128)).working_counter == 0
    main.put(SERVO, IDENTITY)
    main.let_pass(2)
    assert main.read(SERVO, 0x080D, 1)[0] & FULL
    assert main.exchange(EcatCommand.FPRD, SERVO, 0x1080, bytes(128)).working_counter == 1
    assert not main.read(SERVO, 0x080D, 1)[0] & FULL


def test_access_starts_with_the_first_byte_and_ends_with_the_last(main: MainDevice) -> None:
    main.put(SERVO, IDENTITY)
    main.let_pass(2)
    assert main.exchange(EcatCommand.FPRD, SERVO, 0x1088, bytes(120)).working_counter == 0
    head = main.exchange(EcatCommand.FPRD, SERVO, 0x1080, bytes(6))
    assert head.working_counter == 1
    assert main.read(SERVO, 0x080D, 1)[0] & FULL
    main.exchange(EcatCommand.FPRD, SERVO, 0x1086, bytes(122))
    assert not main.read(SERVO, 0x080D, 1)[0] & FULL


def test_wrong_direction_is_refused(main: MainDevice) -> None:
    assert main.exchange(EcatCommand.FPRD, SERVO, 0x1000, bytes(128)).working_counter == 0
    assert main.exchange(EcatCommand.FPWR, SERVO, 0x1080, bytes(128)).working_counter == 0


def test_repeat_returns_the_last_answer_before_the_next(main: MainDevice) -> None:
    first = main.ask(SERVO, IDENTITY)
    main.put(SERVO, struct.pack("<HBHB4x", 0x2000, 0x40, 0x1018, 2))
    main.let_pass(2)
    main.write(SERVO, 0x080E, b"\x03")
    main.let_pass(0.1)
    assert main.read(SERVO, 0x080F, 1) == b"\x02"
    repeated, next_one = main.fetch(SERVO), main.fetch(SERVO)
    assert repeated is not None
    assert next_one is not None
    assert repeated[6:] == first
    assert struct.unpack_from("<HB", next_one, 9) == (0x1018, 2)


def test_repeat_before_any_answer_is_only_acknowledged(main: MainDevice) -> None:
    main.write(SERVO, 0x080E, b"\x03")
    main.let_pass(0.1)
    assert main.read(SERVO, 0x080F, 1) == b"\x02"
    assert main.fetch(SERVO) is None


def test_active_sync_manager_cannot_be_configured(main: MainDevice) -> None:
    assert main.write(SERVO, 0x0800, struct.pack("<HH", 0x2000, 8)) == 0
    assert main.read(SERVO, 0x0800, 4) == struct.pack("<HH", 0x1000, 128)


def test_deactivation_releases_the_memory_and_empties_the_mailbox(main: MainDevice) -> None:
    main.put(SERVO, IDENTITY)
    main.write(SERVO, 0x0806, b"\x00")
    assert main.write(SERVO, 0x1010, b"\xab") == 1
    assert main.read(SERVO, 0x1010, 1) == b"\xab"
    main.write(SERVO, 0x0806, b"\x01")
    assert not main.read(SERVO, 0x0805, 1)[0] & FULL


def test_process_data_is_blocked_until_the_application_releases_it(main: MainDevice) -> None:
    main.sync_manager(SERVO, 2, 0x1100, 13, 0x64)
    assert main.exchange(EcatCommand.FPWR, SERVO, 0x1100, bytes(13)).working_counter == 0


def test_three_buffers_return_the_last_complete_write() -> None:
    segment = Segment([DigitalOutputs()])
    main = MainDevice(segment)
    main.number_stations()
    main.sync_manager(STATION, 0, 0x1000, 2, 0x44)
    assert main.write(STATION, 0x1000, b"\x01\x02") == 1
    assert segment.core.output_image(0, 0) == b"\x01\x02"
    main.write(STATION, 0x1000, b"\x05")  # opened, not completed
    assert segment.core.output_image(0, 0) == b"\x01\x02"
    main.write(STATION, 0x1001, b"\x06")
    assert segment.core.output_image(0, 0) == b"\x05\x06"
    assert main.exchange(EcatCommand.FPWR, STATION, 0x1002, bytes(2)).working_counter == 0


def test_inputs_are_consistent_when_read_in_parts() -> None:
    inputs = DigitalInputs(bits=16)
    main = MainDevice(Segment([inputs]))
    main.number_stations()
    main.sync_manager(STATION, 0, 0x1000, 2, 0x00)
    inputs.inputs = 0x1234
    assert main.read(STATION, 0x1000, 1) == b"\x34"
    inputs.inputs = 0xABCD
    assert main.read(STATION, 0x1001, 1) == b"\x12"
    assert main.read(STATION, 0x1000, 2) == b"\xcd\xab"

"""Write protection and reset (Beckhoff, EtherCAT Slave Controller, section I §17.3, §17.4)."""

from __future__ import annotations

import pytest

from catenary.virtual import DigitalOutputs, Segment, Servo
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from tests.virtual.main_device import MILLISECOND, STATION, MainDevice

REGISTER, USER_RAM, RAM = 0x0010, 0x0F80, 0x1200
REGISTERS_ENABLE, REGISTERS, ESC_ENABLE, ESC = 0x0020, 0x0021, 0x0030, 0x0031
RESET = 0x0040


@pytest.fixture
def main() -> MainDevice:
    main = MainDevice(Segment([DigitalOutputs(), Servo()]))
    main.number_stations()
    return main


def together(main: MainDevice, *writes: tuple[int, bytes]) -> list[int]:
    """Write to the first device in one frame, and return the working counters."""
    datagrams = [Datagram(EcatCommand.APWR, address << 16, data) for address, data in writes]
    main.link.send(encode_frame(datagrams))
    assert main.link.wait_until(main.link.now() + MILLISECOND, True)
    frame = main.link.receive()
    assert frame is not None
    return [datagram.working_counter for datagram in decode_frame(frame).datagrams]


@pytest.mark.parametrize(("protection", "counters"), [(REGISTERS, [0, 1, 1]), (ESC, [0, 0, 0])])
def test_protected_memory(main: MainDevice, protection: int, counters: list[int]) -> None:
    together(main, (protection, b"\x01"))
    addresses = (REGISTER, USER_RAM, RAM)
    assert [together(main, (address, b"\x05"))[0] for address in addresses] == counters


@pytest.mark.parametrize(
    ("protection", "enable"), [(REGISTERS, REGISTERS_ENABLE), (ESC, ESC_ENABLE)]
)
def test_writes_are_enabled_for_one_frame(main: MainDevice, protection: int, enable: int) -> None:
    together(main, (protection, b"\x01"))
    assert together(main, (enable, b"\x01"), (REGISTER, b"\x07")) == [1, 1]
    assert together(main, (REGISTER, b"\x08")) == [0]
    assert main.segment.core.peek(0, REGISTER, 1) == b"\x07"


def test_protection_is_removed_in_the_same_way(main: MainDevice) -> None:
    together(main, (REGISTERS, b"\x01"))
    assert together(main, (REGISTERS, b"\x00")) == [0]
    assert together(main, (REGISTERS_ENABLE, b"\x01"), (REGISTERS, b"\x00")) == [1, 1]
    assert together(main, (REGISTER, b"\x08")) == [1]


def test_process_data_is_not_written_to_a_protected_controller(main: MainDevice) -> None:
    main.let_pass(30)
    main.start_servo(STATION + 1, 0)
    main.write(STATION + 1, ESC, b"\x01")
    assert main.exchange_logical(EcatCommand.LRW, 0, bytes(26)).working_counter == 1
    assert main.exchange_logical(EcatCommand.LWR, 0, bytes(26)).working_counter == 0


def test_reset_sequence_resets_the_device(main: MainDevice) -> None:
    main.start_mailbox(STATION + 1)
    shown = []
    for letter in b"RES":
        main.write(STATION + 1, RESET, bytes([letter]))
        shown.append(main.segment.core.peek(1, RESET, 1)[0])
    assert shown == [1, 2, 0]
    main.let_pass(5)
    assert main.exchange(EcatCommand.BRD, 0, 0, b"\0").working_counter == 1
    main.let_pass(25)
    assert main.exchange(EcatCommand.BRD, 0, 0, b"\0").working_counter == 2
    assert main.segment[1].state == 1
    assert main.segment.core.peek(1, REGISTER, 2) == b"\0\0"


@pytest.mark.parametrize("when", [0, 5])
def test_a_device_that_is_switched_off_during_its_reset_stays_off(
    main: MainDevice, when: int
) -> None:
    """Switch it off right after the request, or while the reset keeps it off [ms]."""
    for letter in b"RES":
        main.write(STATION + 1, RESET, bytes([letter]))
    main.let_pass(when)
    main.segment[1].power_off()
    main.let_pass(40)
    assert main.segment[1].state == 0
    main.segment[1].power_on()
    assert main.segment[1].state == 1


@pytest.mark.parametrize("letters", [b"RRS", b"REX", b"ES", b"SER"])
def test_wrong_sequence_does_not_reset_the_device(main: MainDevice, letters: bytes) -> None:
    for letter in letters:
        main.write(STATION + 1, RESET, bytes([letter]))
    main.let_pass(5)
    assert main.segment[1].state == 1
    assert main.read(STATION + 1, REGISTER, 2) != b"\0\0"

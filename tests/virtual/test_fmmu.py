"""FMMUs: bit-wise mapping of the logical image, and working counters."""

from __future__ import annotations

import pytest

from catenary.virtual import DigitalInputs, DigitalOutputs, Segment, Servo
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import STATION, MainDevice


@pytest.fixture
def main() -> MainDevice:
    """Map two outputs of four bits and two inputs to the bytes 0x40 and 0x41."""
    segment = Segment([DigitalOutputs(), DigitalOutputs(), DigitalInputs(), DigitalInputs()])
    main = MainDevice(segment)
    main.number_stations()
    for k in range(4):
        main.sync_manager(STATION + k, 0, 0x1000, 1, 0x44 if k < 2 else 0x00)
        low = 4 * (k % 2)
        main.fmmu(STATION + k, 0, 0x40 + k // 2, (1, low, low + 3), 0x1000, 2 if k < 2 else 1)
    main.exchange(EcatCommand.BWR, 0, 0x0120, b"\x08\x00")
    return main


def outputs(main: MainDevice) -> list[int]:
    found = [main.segment[0], main.segment[1]]
    return [d.outputs for d in found if isinstance(d, DigitalOutputs)]


def test_each_device_uses_its_own_bits(main: MainDevice) -> None:
    assert main.exchange_logical(EcatCommand.LWR, 0x40, b"\xa5").working_counter == 2
    assert outputs(main) == [0x5, 0xA]


def test_inputs_change_only_their_bits(main: MainDevice) -> None:
    for device, value in zip((main.segment[2], main.segment[3]), (0x3, 0xC), strict=True):
        assert isinstance(device, DigitalInputs)
        device.inputs = value
    answer = main.exchange_logical(EcatCommand.LRD, 0x40, b"\xff\x00\xff")
    assert (answer.data, answer.working_counter) == (b"\xff\xc3\xff", 2)


def test_read_write_counts_two_for_outputs_and_one_for_inputs(main: MainDevice) -> None:
    answer = main.exchange_logical(EcatCommand.LRW, 0x40, b"\x21\x00")
    assert answer.working_counter == 6
    assert answer.data[0] == 0x21
    assert outputs(main) == [0x1, 0x2]


def test_unmapped_addresses_are_not_changed(main: MainDevice) -> None:
    assert main.exchange_logical(EcatCommand.LRW, 0x42, b"\xff\xff").working_counter == 0
    assert main.exchange_logical(EcatCommand.LRW, 0xFFFFFFF0, bytes(64)).working_counter == 0


def test_mapping_across_byte_boundaries() -> None:
    segment = Segment([DigitalOutputs(bits=16)])
    main = MainDevice(segment)
    main.number_stations()
    main.sync_manager(STATION, 0, 0x1000, 2, 0x44)
    main.fmmu(STATION, 0, 0x1000_0000, (3, 6, 5), 0x1000, 2)  # 16 bits from bit 6 on
    assert main.exchange_logical(EcatCommand.LWR, 0x1000_0000, b"\x40\x91\x15").working_counter == 1
    value = int.from_bytes(b"\x40\x91\x15", "little") >> 6 & 0xFFFF
    assert segment.core.output_image(0, 0) == value.to_bytes(2, "little")


def test_device_without_lrw_answers_lrd_and_lwr() -> None:
    main = MainDevice(Segment([Servo(lrw=False)]))
    main.number_stations()
    main.start_servo(STATION, 0)
    assert main.exchange_logical(EcatCommand.LRW, 0, bytes(26)).working_counter == 0
    assert main.exchange_logical(EcatCommand.LWR, 0, bytes(13)).working_counter == 1
    assert main.exchange_logical(EcatCommand.LRD, 13, bytes(13)).working_counter == 1


def test_mailbox_status_can_be_mapped() -> None:
    main = MainDevice(Segment([Servo()]))
    main.number_stations()
    main.start_mailbox(STATION)
    main.fmmu(STATION, 2, 0x200, (1, 0, 0), 0x080D, 1)
    block = bytes(
        [0x00, 0x02, 0, 0, 1, 0, 0, 0, 0x0D, 0x08, 3, 1, 1, 0, 0, 0]
    )  # bit 3 of the register
    main.write(STATION, 0x0620, block)
    assert main.exchange_logical(EcatCommand.LRD, 0x200, b"\0") == (b"\x00", 1, 0x200)
    main.put(STATION, bytes.fromhex("0020401810010000000000"))
    main.let_pass(2)
    assert main.exchange_logical(EcatCommand.LRD, 0x200, b"\0") == (b"\x01", 1, 0x200)

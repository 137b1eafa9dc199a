"""Watchdogs: outputs turn off without process data, and return with it."""

from __future__ import annotations

import struct

import pytest

from catenary.virtual import DigitalOutputs, Segment, Servo
from catenary.wire.datagram import EcatCommand
from tests.virtual.main_device import STATION, MainDevice

OUTPUTS = DigitalOutputs


@pytest.fixture
def main() -> MainDevice:
    main = MainDevice(Segment([OUTPUTS()]))
    main.number_stations()
    main.sync_manager(STATION, 0, 0x1000, 1, 0x44)
    main.write(STATION, 0x0120, b"\x08\x00")
    return main


def outputs(main: MainDevice) -> int:
    device = main.segment[0]
    assert isinstance(device, OUTPUTS)
    return device.outputs


def test_outputs_turn_off_after_100_ms_and_return(main: MainDevice) -> None:
    main.write(STATION, 0x1000, b"\x0f")
    main.let_pass(99)
    assert outputs(main) == 0x0F
    main.let_pass(2)
    assert outputs(main) == 0
    assert main.read(STATION, 0x0440, 1) == b"\x00"
    main.write(STATION, 0x1000, b"\x03")
    assert outputs(main) == 3
    assert main.read(STATION, 0x0442, 1) == b"\x01"


def test_time_and_divider_set_the_timeout(main: MainDevice) -> None:
    main.write(STATION, 0x0400, struct.pack("<H", 2498))  # 100 us
    main.write(STATION, 0x0420, struct.pack("<H", 50))
    main.write(STATION, 0x1000, b"\x0f")
    main.let_pass(4.5)
    assert outputs(main) == 0x0F
    main.let_pass(1)
    assert outputs(main) == 0


def test_time_of_zero_disables_the_watchdog(main: MainDevice) -> None:
    main.write(STATION, 0x0420, b"\x00\x00")
    main.write(STATION, 0x1000, b"\x0f")
    main.let_pass(5000)
    assert outputs(main) == 0x0F
    assert main.read(STATION, 0x0440, 1)[0] & 1


def test_outputs_are_off_below_op(main: MainDevice) -> None:
    main.write(STATION, 0x1000, b"\x0f")
    main.write(STATION, 0x0120, b"\x04\x00")
    assert outputs(main) == 0


def test_pdi_watchdog_expires_for_a_frozen_application() -> None:
    main = MainDevice(Segment([Servo()]))
    main.number_stations()
    main.let_pass(5)
    assert main.read(STATION, 0x0110, 1)[0] & 0x02
    main.segment[0].freeze()
    main.let_pass(200)
    assert not main.read(STATION, 0x0110, 1)[0] & 0x02
    assert main.read(STATION, 0x0443, 1) == b"\x01"


def test_reads_do_not_trigger_the_watchdog(main: MainDevice) -> None:
    main.write(STATION, 0x1000, b"\x0f")
    for _ in range(11):
        main.let_pass(10)
        main.exchange(EcatCommand.BRD, 0, 0x0130, bytes(2))
    assert outputs(main) == 0

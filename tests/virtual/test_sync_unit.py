"""SYNC0 and SYNC1, datasheet of the controllers, section I §9.2.3 and section II §3.49.4."""

from __future__ import annotations

import struct
from typing import Literal

import pytest

from catenary.virtual import Coupler, Crystal, Segment
from tests.virtual.clocks import (
    ACTIVATION,
    CYCLIC_UNIT,
    NEXT_SYNC1,
    OFFSET,
    PENDING,
    PULSE_LENGTH,
    START_TIME,
    SYNC0_CYCLE,
    SYNC1_CYCLE,
    Clocks,
)
from tests.virtual.main_device import STATION

MS = 1_000_000
DEVICE = 1


def clocks(crystal: Crystal | None = None, bits: Literal[32, 64] = 64) -> Clocks:
    second = Coupler(crystal=crystal or Crystal(), clock_bits=bits)
    return Clocks(Segment([Coupler(), second]))


@pytest.fixture
def main() -> Clocks:
    return clocks()


def start(main: Clocks, ahead: int, cycle: int, cycle1: int = 0, activation: int = 0x03) -> int:
    """Activate the unit with the first pulse `ahead` [ns]. Return its system time."""
    first = main.system_time(DEVICE) + ahead
    main.put_number(DEVICE, ACTIVATION, "<B", 0)
    main.put_number(DEVICE, START_TIME, "<Q", first % 2**64)
    main.write(STATION + DEVICE, SYNC0_CYCLE, struct.pack("<II", cycle, cycle1))
    main.put_number(DEVICE, ACTIVATION, "<B", activation)
    return first


def pulses(main: Clocks) -> tuple[int, int]:
    return main.segment.core.pulses(DEVICE)


def test_cyclic_generation(main: Clocks) -> None:
    first = start(main, 10 * MS, MS)
    assert main.number(DEVICE, START_TIME, "<Q") == first
    assert main.number(DEVICE, PENDING, "<B") == 0x01
    main.let_pass(9)
    assert pulses(main) == (0, 0)
    main.let_pass(5.5)
    assert pulses(main)[0] == 5
    assert main.number(DEVICE, PENDING, "<B") == 0
    assert main.number(DEVICE, START_TIME, "<Q") == first + 5 * MS  # the next one
    main.put_number(DEVICE, ACTIVATION, "<B", 0)
    main.let_pass(5)
    assert pulses(main)[0] == 5


def test_pulse_length_comes_from_the_eeprom_only(main: Clocks) -> None:
    assert main.number(DEVICE, PULSE_LENGTH, "<H") == 100  # 1 us
    assert main.put_number(DEVICE, PULSE_LENGTH, "<H", 1) == 0


def test_start_time_is_written_while_the_unit_is_inactive(main: Clocks) -> None:
    first = start(main, 10 * MS, MS)
    assert main.put_number(DEVICE, START_TIME, "<Q", 1) == 0
    assert main.number(DEVICE, START_TIME, "<Q") == first


def test_frames_cannot_change_a_unit_under_pdi_control(main: Clocks) -> None:
    main.put_number(DEVICE, CYCLIC_UNIT, "<B", 1)
    for address in (ACTIVATION, START_TIME, SYNC0_CYCLE, SYNC1_CYCLE):
        assert main.put_number(DEVICE, address, "<B", 1) == 0
    main.put_number(DEVICE, CYCLIC_UNIT, "<B", 0)
    assert main.put_number(DEVICE, SYNC0_CYCLE, "<I", 1) == 1


def test_bits_that_an_et1100_lacks_are_not_implemented(main: Clocks) -> None:
    main.put_number(DEVICE, ACTIVATION, "<B", 0xF8)
    assert main.number(DEVICE, ACTIVATION, "<B") == 0
    assert main.number(0, 0x0008, "<H") & 0x0100 == 0  # no enhanced SYNC activation


def test_single_shot(main: Clocks) -> None:
    start(main, 2 * MS, 0)
    main.let_pass(20)
    assert pulses(main) == (1, 0)


def test_overlapping_pulses_are_one_pulse(main: Clocks) -> None:
    start(main, 2 * MS, 500)
    main.let_pass(20)
    assert pulses(main) == (1, 0)


@pytest.mark.parametrize("bits", [64, 32])
def test_start_in_the_past_is_reached_after_the_clock_wraps(bits: Literal[32, 64]) -> None:
    main = clocks(bits=bits)
    start(main, -1 * MS, 100 * MS)
    main.let_pass(4_200)
    assert pulses(main) == (0, 0)
    main.let_pass(150)
    assert pulses(main)[0] == (0 if bits == 64 else 1)


def test_pulses_skipped_by_an_offset_do_not_occur(main: Clocks) -> None:
    start(main, 10 * MS, MS)
    main.put_number(DEVICE, OFFSET, "<q", 50 * MS)
    main.let_pass(100)
    assert pulses(main) == (0, 0)


def test_negative_offset_change_delays_the_pulses(main: Clocks) -> None:
    start(main, 10 * MS, MS)
    main.put_number(DEVICE, OFFSET, "<q", -5 * MS)
    main.let_pass(14)
    assert pulses(main) == (0, 0)
    main.let_pass(2)
    assert pulses(main)[0] > 0


@pytest.mark.parametrize(
    ("cycle1", "expected"),
    [
        (0, [0, 10, 20, 30]),  # equal to SYNC0
        (4, [4, 14, 24, 34]),  # its cycle is a delay after SYNC0
        (10, [10, 30]),  # a simultaneous SYNC0 does not start SYNC1
        (13, [13, 33]),  # from the first SYNC0 after the last SYNC1: at 20
        (20, [20, 50]),
    ],
)
def test_sync1_follows_sync0(cycle1: int, expected: list[int]) -> None:
    """SYNC0 occurs every 10 ms from 0 on, section I §9.2.3.5.

    If both coincide, the cycle of SYNC1 is the sum of both registers. Beckhoff's slave stack (SSC
    5.13, ecatslv.c, StartInputHandler), SOEM (`ecx_dcsync01`) and IgH (fsm_slave_config.c) agree.
    """
    main = clocks()
    first = start(main, 5 * MS, 10 * MS, cycle1 * MS, activation=0x07)
    assert main.number(DEVICE, PENDING, "<B") == 0x03
    seen, instants = 0, []
    for k in range(52):
        now = first + k * MS + MS // 2
        main.let_pass((now - main.system_time(DEVICE)) / MS)
        if pulses(main)[1] > seen:
            seen += 1
            instants.append(k)
            assert pulses(main)[1] == seen
    assert instants[: len(expected)] == expected


def test_the_next_sync1_can_be_read(main: Clocks) -> None:
    first = start(main, 5 * MS, 10 * MS, 4 * MS, activation=0x07)
    main.let_pass(6)
    assert main.number(DEVICE, NEXT_SYNC1, "<Q") == first + 4 * MS


def test_sync1_alone_is_timed_from_sync0(main: Clocks) -> None:
    start(main, 5 * MS, 10 * MS, 4 * MS, activation=0x05)
    main.let_pass(20)
    assert pulses(main) == (0, 2)


def test_pulses_follow_the_steered_system_time() -> None:
    """The crystal is 100 ppm slow, but the 1000 pulses follow the time of the reference clock."""
    main = clocks(Crystal(ppm=-100))
    main.align()
    main.burst(5_000)
    first = start(main, 10 * MS, MS)
    reference = main.system_time(0)
    main.run(1_010)
    passed = main.system_time(0) - reference
    assert passed > 1_000 * MS
    assert abs(pulses(main)[0] - (main.system_time(0) - first) / MS) <= 1.01
    free = main.segment.core.pulses(DEVICE)[0]
    main.let_pass(10_000)  # without steering, the loop keeps its last speed
    assert main.segment.core.pulses(DEVICE)[0] - free == pytest.approx(10_000, abs=1)


def test_pulses_follow_an_unsteered_crystal_that_slows_down() -> None:
    """The pulse occurs although it is still ahead at the time computed from the earlier rate."""
    main = clocks(Crystal(drift_ppm=200, drift_period=1.0))
    main.let_pass(240)
    main.burst(1)
    first = start(main, 10 * MS, MS)
    main.let_pass(500)
    assert abs(pulses(main)[0] - (main.system_time(DEVICE) - first) / MS) <= 1.01

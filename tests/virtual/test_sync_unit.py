"""SYNC0 and SYNC1, section I §9.2.3 and section II §3.49.4 of the controllers' datasheet."""

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
    """Switches the unit on, the first pulse `ahead` of now [ns]; that pulse's system time."""
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


def test_the_pulse_length_is_the_eeproms_and_no_frames(main: Clocks) -> None:
    assert main.number(DEVICE, PULSE_LENGTH, "<H") == 100  # 1 us
    assert main.put_number(DEVICE, PULSE_LENGTH, "<H", 1) == 0


def test_a_start_time_is_written_while_the_unit_is_off(main: Clocks) -> None:
    first = start(main, 10 * MS, MS)
    assert main.put_number(DEVICE, START_TIME, "<Q", 1) == 0
    assert main.number(DEVICE, START_TIME, "<Q") == first


def test_a_unit_that_the_device_controls_takes_nothing_from_frames(main: Clocks) -> None:
    main.put_number(DEVICE, CYCLIC_UNIT, "<B", 1)
    for address in (ACTIVATION, START_TIME, SYNC0_CYCLE, SYNC1_CYCLE):
        assert main.put_number(DEVICE, address, "<B", 1) == 0
    main.put_number(DEVICE, CYCLIC_UNIT, "<B", 0)
    assert main.put_number(DEVICE, SYNC0_CYCLE, "<I", 1) == 1


def test_bits_an_et1100_lacks_are_not_there(main: Clocks) -> None:
    main.put_number(DEVICE, ACTIVATION, "<B", 0xF8)
    assert main.number(DEVICE, ACTIVATION, "<B") == 0
    assert main.number(0, 0x0008, "<H") & 0x0100 == 0  # no enhanced SYNC activation


def test_a_single_shot(main: Clocks) -> None:
    start(main, 2 * MS, 0)
    main.let_pass(20)
    assert pulses(main) == (1, 0)


def test_a_signal_that_is_never_down_again_is_one_pulse(main: Clocks) -> None:
    start(main, 2 * MS, 500)
    main.let_pass(20)
    assert pulses(main) == (1, 0)


@pytest.mark.parametrize("bits", [64, 32])
def test_a_start_in_the_past_comes_when_the_clock_has_gone_round(bits: Literal[32, 64]) -> None:
    main = clocks(bits=bits)
    start(main, -1 * MS, 100 * MS)
    main.let_pass(4_200)
    assert pulses(main) == (0, 0)
    main.let_pass(150)
    assert pulses(main)[0] == (0 if bits == 64 else 1)


def test_pulses_an_offset_jumps_over_do_not_come(main: Clocks) -> None:
    start(main, 10 * MS, MS)
    main.put_number(DEVICE, OFFSET, "<q", 50 * MS)
    main.let_pass(100)
    assert pulses(main) == (0, 0)


def test_an_offset_that_sets_the_clock_back_delays_the_pulses(main: Clocks) -> None:
    start(main, 10 * MS, MS)
    main.put_number(DEVICE, OFFSET, "<q", -5 * MS)
    main.let_pass(14)
    assert pulses(main) == (0, 0)
    main.let_pass(2)
    assert pulses(main)[0] > 0


@pytest.mark.parametrize(
    ("cycle1", "expected"),
    [
        (0, [0, 10, 20, 30]),  # reflects SYNC0
        (4, [4, 14, 24, 34]),  # its cycle is a delay behind SYNC0
        (10, [10, 30]),  # a SYNC0 at the same time starts none
        (13, [13, 33]),  # from the first SYNC0 after the last SYNC1: at 20
        (20, [20, 50]),
    ],
)
def test_sync1_follows_sync0(cycle1: int, expected: list[int]) -> None:
    """SYNC0 every 10 ms from 0 on; section I §9.2.3.5. Where both coincide, the cycle of SYNC1 is
    its register plus SYNC0's. So compute it: Beckhoff's slave stack (SSC 5.13, ecatslv.c,
    StartInputHandler), SOEM (`ecx_dcsync01`) and IgH (fsm_slave_config.c)."""
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


def test_sync1_alone_counts_from_sync0s_instants(main: Clocks) -> None:
    start(main, 5 * MS, 10 * MS, 4 * MS, activation=0x05)
    main.let_pass(20)
    assert pulses(main) == (0, 2)


def test_pulses_follow_the_system_time_that_is_steered() -> None:
    """A crystal 100 ppm slow: 1000 pulses of the reference's milliseconds, not of its own."""
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
    main.let_pass(10_000)  # nobody steers now: the loop keeps the speed it found
    assert main.segment.core.pulses(DEVICE)[0] - free == pytest.approx(10_000, abs=1)


def test_pulses_follow_a_crystal_that_slows_down_while_nobody_steers() -> None:
    """At the instant computed from its rate so far the pulse is still ahead, and comes."""
    main = clocks(Crystal(drift_ppm=200, drift_period=1.0))
    main.let_pass(240)
    main.burst(1)
    first = start(main, 10 * MS, MS)
    main.let_pass(500)
    assert abs(pulses(main)[0] - (main.system_time(DEVICE) - first) / MS) <= 1.01

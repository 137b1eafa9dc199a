"""Registers: formats, indexed registers, and consistency of the map."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire import register
from catenary.wire.register import Register

REGISTERS = [value for value in vars(register).values() if isinstance(value, Register)]
INTEGERS = [each for each in REGISTERS if not each.format.endswith("s")]


# ESC data sheet, section II, table 1: name, first and last address
@pytest.mark.parametrize(
    ("each", "first", "last"),
    [
        (register.FEATURES, 0x0008, 0x0009),
        (register.DL_CONTROL, 0x0100, 0x0103),
        (register.DL_STATUS, 0x0110, 0x0111),
        (register.AL_CONTROL, 0x0120, 0x0121),
        (register.AL_STATUS_CODE, 0x0134, 0x0135),
        (register.AL_EVENT_REQUEST, 0x0220, 0x0223),
        (register.WATCHDOG_TIME_PROCESS_DATA, 0x0420, 0x0421),
        (register.SII_DATA, 0x0508, 0x050F),
        (register.RECEIVE_TIME_PROCESSING_UNIT, 0x0918, 0x091F),
        (register.SYSTEM_TIME_DIFFERENCE, 0x092C, 0x092F),
        (register.SYNC0_START_TIME, 0x0990, 0x0997),
        (register.SYNC1_CYCLE_TIME, 0x09A4, 0x09A7),
        (register.fmmu(15), 0x06F0, 0x06FF),
        (register.sync_manager(3), 0x0818, 0x081F),
        (register.sync_manager_status(1), 0x080D, 0x080D),
        (register.sync_manager_activation(1), 0x080E, 0x080E),
        (register.sync_manager_pdi_control(1), 0x080F, 0x080F),
        (register.receive_time(3), 0x090C, 0x090F),
        (register.rx_error_counter(2), 0x0304, 0x0305),
        (register.lost_link_counter(3), 0x0313, 0x0313),
    ],
    ids=str,
)
def test_addresses_match_the_data_sheet(each, first, last):
    assert (each.address, each.address + each.size - 1) == (first, last)


def test_numbers_overlap_only_with_their_halves():
    ranges = sorted((each.address, each.address + each.size, each.name) for each in INTEGERS)
    overlaps = [(low[2], high[2]) for low, high in itertools.pairwise(ranges) if high[0] < low[1]]
    assert overlaps == [
        ("system time, low half", "system time"),
        ("system time offset, low half", "system time offset"),
        (
            "start time cyclic operation, low half",
            "start time cyclic operation, next SYNC0 pulse",
        ),
    ]


@pytest.mark.parametrize("each", INTEGERS, ids=str)
@settings(max_examples=10)
@given(data=st.data())
def test_integers_round_trip(each, data):
    raw = data.draw(st.binary(min_size=each.size, max_size=each.size))
    assert each.pack(each.unpack(raw)) == raw


@pytest.mark.parametrize("each", REGISTERS, ids=str)
def test_a_wrong_length_is_refused(each):
    for size in (0, each.size - 1, each.size + 1):
        with pytest.raises(DecodeError, match=str(each.size)):
            each.unpack(bytes(size))


def test_little_endian_and_signs():
    assert register.AL_STATUS_CODE.pack(0x0011) == b"\x11\x00"
    assert register.SPEED_COUNTER_DIFFERENCE.unpack(b"\xff\xff") == -1


def test_values_that_do_not_fit_are_refused_before_sending():
    with pytest.raises(ValueError, match=r"AL control \(0x0120\)"):
        register.AL_CONTROL.pack(0x10000)
    with pytest.raises(ValueError, match="needs 8 bytes, got 7"):
        register.sync_manager(0).pack(bytes(7))


@pytest.mark.parametrize("make", [register.fmmu, register.sync_manager, register.receive_time])
def test_indices_outside_the_map_are_refused(make):
    for number in (-1, 16):
        with pytest.raises(ValueError, match=str(number)):
            make(number)

"""Distributed clocks: the block, and the sign-magnitude difference."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.clock import Clock, decode_clock, decode_difference, encode_difference
from tests.wire.strategies import u8, u16, u32, u64

difference = st.integers(-(1 << 31) + 1, (1 << 31) - 1)
clocks = st.builds(
    Clock,
    *(st.tuples(u32, u32, u32, u32), u64, u64, u64, u32, difference, u16),
    *(st.integers(-(1 << 15), (1 << 15) - 1), u8, u8, u8),
)


def test_receive_times_of_a_coupler():
    # ethercrab's tests/replay-dc.pcapng, frames 505 (0x0900), 503 (0x0918), 515 (0x0920)
    block = bytes.fromhex(
        "520f623caa11623c000000005665726c" + "48693a0000000000" + "520f623cf5000000"
        "aef09dc30affffff" + "00000000" + "05000080" + "0010" + "0000" + "000c" + "0000"
    )
    clock = decode_clock(block)
    assert clock.receive_times_ns[1] - clock.receive_times_ns[0] == 600
    assert clock.receive_time_processing_unit_ns == 0xF53C620F52
    assert (clock.receive_time_processing_unit_ns + clock.offset_ns) % 2**64 < 2**32
    assert clock.difference_ns == -5
    assert clock.speed_counter_start == 0x1000
    assert (clock.difference_filter, clock.speed_counter_filter) == (0, 12)
    assert clock.encode() == block


@given(clocks)
def test_round_trip(clock):
    assert decode_clock(clock.encode()) == clock


@pytest.mark.parametrize(
    ("raw", "difference_ns"),
    [(0, 0), (5, 5), (0x80000005, -5), (0x80000000, 0), (0x7FFFFFFF, 2**31 - 1)],
)
def test_the_difference_is_sign_magnitude(raw, difference_ns):
    assert decode_difference(raw) == difference_ns


@given(difference)
def test_a_difference_round_trips(value):
    assert decode_difference(encode_difference(value)) == value


def test_refusals():
    with pytest.raises(ValueError, match="beyond"):
        encode_difference(-(1 << 31))
    with pytest.raises(DecodeError, match="32 bits"):
        decode_difference(1 << 32)
    with pytest.raises(DecodeError, match="needs 56"):
        decode_clock(bytes(55))

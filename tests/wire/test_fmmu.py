"""FMMU blocks."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire import fmmu
from catenary.wire.fmmu import Fmmu, decode_fmmu
from tests.wire.strategies import flag, u16, u32

bit = st.integers(0, 7)
blocks = st.builds(Fmmu, *(u32, u16, bit, bit, u16, bit, flag, flag, flag))


def test_golden_block():
    # ethercrab's tests/replay-dc.pcapng, frame 3018: the second output byte of an EL2889
    block = bytes.fromhex("0200000001000007010f000201000000")
    assert decode_fmmu(block) == Fmmu(2, 1, 0, 7, 0x0F01, 0, writes=True)
    assert Fmmu(2, 1, 0, 7, 0x0F01, 0, writes=True).encode() == block


@given(blocks)
def test_round_trip(block):
    assert decode_fmmu(block.encode()) == block


def test_bits_across_bytes():
    # 6 bits from bit 5 of logical byte 0x100, at bit 2 of physical byte 0x1100
    made = fmmu.bits(0x100 * 8 + 5, 0x1100 * 8 + 2, 6, reads=True)
    assert made == Fmmu(0x100, 2, 5, 2, 0x1100, 2, reads=True)


@given(st.integers(0, 1 << 34), st.integers(0, 1 << 18), st.integers(1, 4000))
def test_bits_maps_the_given_number_of_bits(logical, physical, length):
    made = fmmu.bits(logical, physical, length, writes=True)
    assert made.bit_length == length
    assert made.logical_address * 8 + made.logical_start_bit == logical
    assert made.physical_address * 8 + made.physical_start_bit == physical


def test_refusals():
    with pytest.raises(DecodeError, match="needs 16"):
        decode_fmmu(bytes(15))
    with pytest.raises(ValueError, match="0 to 7"):
        Fmmu(0, 1, 0, 8, 0, 0).encode()
    with pytest.raises(ValueError, match="bit_length must be at least 1"):
        fmmu.bits(0, 0, 0)
    with pytest.raises(ValueError, match="FMMU"):
        Fmmu(1 << 32, 1, 0, 7, 0, 0).encode()

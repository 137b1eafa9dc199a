"""Encoding and decoding of error counters."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.error_counters import ErrorCounters, PortErrors, decode_error_counters
from tests.wire.strategies import u8

# Registers 0x0300 to 0x0313, from Beckhoff's ESC data sheet II, §3.33 to §3.38: invalid frames and
# RX errors of ports 0 to 3, forwarded errors, processing unit, PDI, two unused, lost links
BLOCK = bytes.fromhex("01 02 03 04 05 06 07 08 11 12 13 14 20 21 00 00 31 32 33 34")

ports = st.builds(PortErrors, u8, u8, u8, u8)
counters = st.builds(ErrorCounters, st.tuples(ports, ports, ports, ports), u8, u8)


def test_position_of_every_counter() -> None:
    found = decode_error_counters(BLOCK)
    assert found.ports == (
        PortErrors(1, 2, 0x11, 0x31),
        PortErrors(3, 4, 0x12, 0x32),
        PortErrors(5, 6, 0x13, 0x33),
        PortErrors(7, 8, 0x14, 0x34),
    )
    assert (found.processing_unit, found.pdi) == (0x20, 0x21)
    assert found.encode() == BLOCK


@given(counters)
def test_counters_round_trip(value: ErrorCounters) -> None:
    assert decode_error_counters(value.encode()) == value


@pytest.mark.parametrize("size", [0, 19, 21])
def test_a_wrong_length_is_refused(size: int) -> None:
    with pytest.raises(DecodeError, match=f"needs 20 bytes, got {size}"):
        decode_error_counters(bytes(size))


def test_a_counter_above_255_is_refused() -> None:
    with pytest.raises(ValueError, match="error counters"):
        ErrorCounters(pdi=256).encode()


@given(counters, counters)
def test_counts_since_an_earlier_reading(before: ErrorCounters, after: ErrorCounters) -> None:
    new = after.since(before)
    if after.restarted(before):
        assert new == after
        return
    assert [a - b for a, b in zip(after.encode(), before.encode(), strict=True)] == list(
        new.encode()
    )


def test_nonzero_counters_are_true() -> None:
    assert not ErrorCounters()
    assert ErrorCounters(pdi=1)
    assert decode_error_counters(bytes(16) + b"\x00\x00\x01\x00")

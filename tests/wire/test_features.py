"""ESC information."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.features import Feature, Information, PortKind, decode_information


def test_a_coupler_with_64_bit_clocks_and_lrw():
    # An ET1100: type 0x11; features of the EK1100 in ethercrab's tests/replay-dc.pcapng, frame 211
    information = decode_information(bytes.fromhex("11000200080808fbfc00"))
    assert (information.type, information.build) == (0x11, 2)
    assert (information.fmmu_count, information.sync_manager_count) == (8, 8)
    assert information.ram_size == 8
    assert information.ports == (PortKind.MII, PortKind.EBUS, PortKind.MII, PortKind.MII)
    assert information.supports_lrw
    assert information.clock_bits == 64


@pytest.mark.parametrize(
    ("features", "clock_bits", "lrw"),
    [(0, 0, True), (Feature.NO_LRW, 0, False), (Feature.DISTRIBUTED_CLOCKS, 32, True)],
)
def test_properties_of_features(features, clock_bits, lrw):
    ports = (PortKind.MII,) * 4
    information = Information(0, 0, 0, 0, 0, 0, ports, Feature(features))
    assert (information.clock_bits, information.supports_lrw) == (clock_bits, lrw)


@given(st.binary(min_size=10, max_size=10))
def test_ten_bytes_round_trip(data):
    assert decode_information(data).encode() == data


def test_a_wrong_length_is_refused():
    for size in (0, 9, 11):
        with pytest.raises(DecodeError, match="needs 10"):
            decode_information(bytes(size))

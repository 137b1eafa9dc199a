"""Datagrams: golden bytes, round trips, errors."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.datagram import Datagram, EcatCommand, decode_datagram
from tests.wire.strategies import datagrams

# ethercrab's tests/replay-ek1100-el2828-el2889.pcapng, frame 2296: FPRD of AL status, more follows
GOLDEN = bytes.fromhex("047c001030010280000000000000")


def test_golden_bytes():
    datagram, more_follows = decode_datagram(GOLDEN)
    assert datagram == Datagram(EcatCommand.FPRD, 0x0130_1000, b"\x00\x00", index=0x7C)
    assert (datagram.adp, datagram.ado) == (0x1000, 0x0130)
    assert more_follows
    assert datagram.encode(more_follows=True) == GOLDEN


@given(datagrams, st.booleans(), st.binary(max_size=20))
def test_round_trip_at_any_offset(datagram, more_follows, before):
    encoded = before + datagram.encode(more_follows=more_follows) + b"rest"
    assert decode_datagram(encoded, len(before)) == (datagram, more_follows)
    assert datagram.size == len(encoded) - len(before) - 4


def test_circulating_is_bit_14_of_the_length():
    encoded = Datagram(EcatCommand.NOP, 0, b"", circulating=True).encode()
    assert encoded[6:8] == b"\x00\x40"


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (GOLDEN[:11], "needs 12 bytes, 11 left"),
        (GOLDEN[:-1], "specifies 2 bytes of data, 1 received"),
        (b"\x0f" + GOLDEN[1:], "unknown command 15"),
        (GOLDEN[:7] + b"\x08" + GOLDEN[8:], "reserved bits"),
    ],
)
def test_errors_name_the_reason(data, reason):
    with pytest.raises(DecodeError, match=reason):
        decode_datagram(data)


def test_an_offset_outside_the_data_is_refused():
    for offset in (-1, len(GOLDEN)):
        with pytest.raises(DecodeError):
            decode_datagram(GOLDEN, offset)


@pytest.mark.parametrize(
    "datagram",
    [
        Datagram(EcatCommand.LRW, 1 << 32, b""),
        Datagram(EcatCommand.LRW, 0, b"", index=256),
        Datagram(EcatCommand.LRW, 0, bytes(2048)),
    ],
)
def test_fields_that_do_not_fit_are_refused_before_sending(datagram):
    with pytest.raises(ValueError, match="datagram"):
        datagram.encode()


def test_reads_writes_and_is_logical():
    readers = [command for command in EcatCommand if command.reads]
    assert EcatCommand.LRW.reads
    assert EcatCommand.LRW.writes
    assert EcatCommand.LRW.is_logical
    assert EcatCommand.BWR not in readers
    assert not EcatCommand.FPRD.writes
    assert not EcatCommand.NOP.reads
    assert not EcatCommand.NOP.writes
    assert [command.value for command in EcatCommand] == list(range(15))

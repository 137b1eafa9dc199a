"""Mailbox header and error reply."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.mailbox import (
    ErrorCode,
    ErrorReply,
    Mailbox,
    Type,
    decode_error,
    decode_mailbox,
    next_counter,
)
from tests.wire.strategies import u16

# ethercrab's tests/replay-ek1914-el3004-configure.pcapng, frame 952: the first 16 of 128 bytes
GOLDEN = bytes.fromhex("0a000000001300202f121c0000000000")

mailboxes = st.builds(
    Mailbox,
    *(st.sampled_from(Type), st.binary(max_size=60), st.integers(0, 7), u16),
    *(st.integers(0, 3), st.integers(0, 63)),
)


def test_golden_bytes():
    message = Mailbox(Type.COE, GOLDEN[6:], counter=1)
    assert decode_mailbox(GOLDEN.ljust(128, b"\x00")) == message
    assert message.encode() == GOLDEN
    assert message.encode(128) == GOLDEN.ljust(128, b"\x00")


@given(mailboxes, st.binary(max_size=20))
def test_round_trip_with_trailing_bytes(message, stale):
    assert decode_mailbox(message.encode() + stale) == message


@given(st.binary(max_size=100))
def test_any_bytes_give_a_value_or_decode_error(data):
    try:
        message = decode_mailbox(data)
    except DecodeError:
        return
    assert message.data == data[6 : 6 + len(message.data)]


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (GOLDEN[:5], "needs 6 bytes, received 5"),
        (GOLDEN[:15], "specifies 10 bytes, 9 received"),
        (GOLDEN[:5] + b"\x17" + GOLDEN[6:], "unknown protocol 7"),
    ],
)
def test_errors_name_the_reason(data, reason):
    with pytest.raises(DecodeError, match=reason):
        decode_mailbox(data)


def test_values_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="exceeds the mailbox of 15"):
        decode_mailbox(GOLDEN).encode(15)
    with pytest.raises(ValueError, match="out of range"):
        Mailbox(Type.COE, b"", counter=8).encode()
    with pytest.raises(ValueError, match="mailbox"):
        Mailbox(Type.COE, b"", address=0x10000).encode()


def test_the_counter_skips_zero():
    counters = [0]
    for _ in range(8):
        counters.append(next_counter(counters[-1]))
    assert counters == [0, 1, 2, 3, 4, 5, 6, 7, 1]


@pytest.mark.parametrize("code", ErrorCode)
def test_errors_have_a_text(code):
    reply = decode_error(ErrorReply(code).encode())
    assert reply.code == code
    assert "unknown" not in reply.text


def test_an_error_code_that_the_standard_does_not_define():
    assert decode_error(b"\x01\x00\x34\x12").text == "unknown mailbox error 0x1234"


def test_a_reply_of_another_type_is_refused():
    with pytest.raises(DecodeError, match="type 2"):
        decode_error(b"\x02\x00\x01\x00")
    with pytest.raises(DecodeError, match="needs 4"):
        decode_error(b"\x01\x00")

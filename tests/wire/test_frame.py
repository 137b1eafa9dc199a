"""Frames: golden bytes, exact round trips, alien frames."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire import frame
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import Frame, decode_frame, encode_frame, is_alien, is_own
from tests.fuzz.fuzz_wire import FRAME, TWINCAT_FRAME
from tests.wire.strategies import frames


def test_two_datagrams_in_a_frame():
    decoded = decode_frame(FRAME)
    assert [each.index for each in decoded.datagrams] == [0x7C, 0x7D]
    assert [each.ado for each in decoded.datagrams] == [0x0130, 0x0130]
    assert not decoded.has_passed_controller
    assert decoded.encode() == FRAME


def test_a_header_length_that_includes_padding():
    decoded = decode_frame(TWINCAT_FRAME)
    assert (len(decoded.padding), decoded.counted_padding) == (31, 1)
    assert decoded.encode() == TWINCAT_FRAME


@given(frames())
def test_round_trip(value):
    assert decode_frame(value.encode()) == value


@given(st.binary(max_size=200))
def test_any_payload_gives_a_frame_with_the_same_bytes_or_decode_error(payload):
    data = FRAME[:14] + payload
    with contextlib.suppress(DecodeError):
        assert decode_frame(data).encode() == data


def test_padding_to_the_ethernet_minimum():
    encoded = encode_frame([Datagram(EcatCommand.BRD, 0, b"\x00")])
    assert len(encoded) == 60
    assert encoded[12:16] == bytes.fromhex("88a40d10")
    assert decode_frame(encoded).padding == bytes(60 - 16 - 13)


def test_the_largest_frame():
    encoded = encode_frame([Datagram(EcatCommand.LRW, 0, bytes(frame.MAXIMUM_DATA))])
    assert len(encoded) == frame.MAXIMUM_SIZE
    with pytest.raises(ValueError, match="exceed the 1498 bytes"):
        encode_frame([Datagram(EcatCommand.LRW, 0, bytes(frame.MAXIMUM_DATA + 1))])


@pytest.mark.parametrize(
    "value",
    [
        Frame(()),
        Frame((Datagram(EcatCommand.NOP, 0, b""),), source=b"short"),
        Frame((Datagram(EcatCommand.NOP, 0, b""),), counted_padding=1),
    ],
)
def test_impossible_frames_are_refused(value):
    with pytest.raises(ValueError, match=r"frame needs|6 bytes|padding"):
        value.encode()


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "0 bytes, needs at least 28"),
        (FRAME[:27], "27 bytes, needs at least 28"),
        (FRAME.ljust(1515), "at most 1514"),
        (FRAME[:12] + b"\x08\x00" + FRAME[14:], "EtherType 0x0800"),
        (FRAME[:12] + b"\x81\x00\x00\x01" + FRAME[12:], "VLAN-tagged"),
        (FRAME[:14] + b"\x1c\x40" + FRAME[16:], "type 4 instead of 1"),
        (FRAME[:14] + b"\x1c\x18" + FRAME[16:], "reserved bit 11"),
    ],
)
def test_alien_frames_are_refused_with_the_reason(data, reason):
    assert is_alien(data)
    with pytest.raises(DecodeError, match=reason):
        decode_frame(data)


def test_a_truncated_frame_is_refused():
    with pytest.raises(DecodeError, match="specifies 28 bytes, but 27 were received"):
        decode_frame(FRAME[:-1])


def test_own_frames_are_recognised_after_a_controller():
    source = FRAME[6:12]
    passed = FRAME[:6] + bytes([source[0] | frame.PASSED_CONTROLLER]) + FRAME[7:]
    assert is_own(FRAME, source)
    assert is_own(passed, source)
    assert decode_frame(passed).has_passed_controller
    assert not is_own(FRAME, b"\x20" + source[1:])
    assert not is_own(FRAME, source[:-1] + b"\x00")
    assert not is_own(b"", source)

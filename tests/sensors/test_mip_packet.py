"""MIP packets in a stream of bytes. The golden bytes are those of the manufacturer."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.sensors.mip_packet import (
    REST_NS,
    Field,
    Packet,
    PacketSearch,
    decode_packet,
    encode_packet,
)
from catenary.sensors.sensor import Counters
from tests.sensors import mip_device as device

# 3DM-GX5-45 data communications protocol manual, 8500-0064, sections 4.1.1 and 4.1.9
PING = bytes.fromhex("7565 0102 0201 E0C6")
RESET_REPLY = bytes.fromhex("7565 0104 04F1 7E00 5264")
# mip_sdk, test/data/packet_example_cpp_check.txt
SENSOR_DATA = bytes.fromhex(
    "7565804C0AD5000000055EE67CC00AD6000000014E434A000E043D9EE88D387FDB00BF7AAF03"
    "0E05BB0C1E30BB572E68BBAA24AE0E07BC8AAC80BC72C50EBCC4E2C10E083EEE3D9FBD66DADDC0AFDEF59196"
)
FRAMES = st.tuples(
    st.integers(1, 0xFF),
    st.lists(st.tuples(st.integers(1, 0xFF), st.binary(max_size=20)), max_size=8),
)


def read(*pieces: bytes, counters: Counters | None = None) -> list[Packet]:
    search = PacketSearch(counters or Counters())
    return [packet for piece in pieces for packet in search.feed(piece, 0)]


def test_packets_of_the_manual() -> None:
    assert encode_packet(0x01, [Field(0x01, b"")]) == PING
    assert read(PING, RESET_REPLY) == [
        Packet(0x01, (Field(0x01, b""),)),
        Packet(0x01, (Field(0xF1, b"\x7e\x00"),)),
    ]


def test_a_data_packet_of_the_manufacturer() -> None:
    (packet,) = read(SENSOR_DATA)
    assert [field.descriptor for field in packet.fields] == [0xD5, 0xD6, 0x04, 0x05, 0x07, 0x08]
    assert struct.unpack(">Q", packet.fields[0].data) == (23_067_000_000,)


@given(FRAMES)
def test_encoded_packets_equal_those_of_another_encoder(frame) -> None:
    number, fields = frame
    encoded = encode_packet(number, [Field(*each) for each in fields])
    assert encoded == device.packet(number, *fields)
    assert decode_packet(encoded) == Packet(number, tuple(Field(*each) for each in fields))


@given(st.lists(st.integers(1, 5), min_size=1, max_size=30))
def test_bytes_arrive_in_pieces(sizes: list[int]) -> None:
    stream = SENSOR_DATA + PING
    cuts = [sum(sizes[:k]) for k in range(len(sizes) + 1)]
    pieces = [stream[a:b] for a, b in zip(cuts, [*cuts[1:], len(stream)], strict=True)]
    assert read(*pieces) == read(stream)


@given(st.lists(st.binary(max_size=40), max_size=8))
def test_every_byte_is_part_of_a_packet_or_counted(pieces: list[bytes]) -> None:
    counters = Counters()
    search = PacketSearch(counters)
    found = [packet for piece in [*pieces, PING] for packet in search.feed(piece, 0)]
    used = sum(6 + sum(2 + len(field.data) for field in each.fields) for each in found)
    total = sum(map(len, pieces)) + len(PING)
    assert used + counters.garbage + len(search._rest) == total


def test_garbage_is_skipped_and_counted() -> None:
    counters = Counters()
    assert len(read(b"\x75\x00noise\x75", PING, b"ue", counters=counters)) == 1
    assert counters.garbage == 8


def test_a_wrong_checksum_does_not_hide_the_next_packet() -> None:
    counters = Counters()
    damaged = bytearray(SENSOR_DATA)
    damaged[30] ^= 0x10
    assert len(read(bytes(damaged) + PING, counters=counters)) == 1
    assert (counters.bad_checksums, counters.garbage) == (1, len(SENSOR_DATA))


def test_a_packet_inside_a_damaged_one_is_found() -> None:
    assert len(read(b"ue\x80\x08" + PING + b"\0\0")) == 1


def test_a_truncated_packet_is_dropped_after_a_time() -> None:
    search = PacketSearch(Counters())
    assert list(search.feed(b"ue\x80\xff" + PING, 0)) == []
    assert list(search.feed(b"", REST_NS)) == []
    assert len(list(search.feed(b"", REST_NS + 1))) == 1


@pytest.mark.parametrize("payload", [b"\x01\x04", b"\x05\x04\x00", b"\x00"])
def test_lengths_of_fields_that_do_not_fit(payload: bytes) -> None:
    counters = Counters()
    message = b"ue\x80" + bytes((len(payload),)) + payload
    low = sum(message) % 256
    high = sum((len(message) - k) * byte for k, byte in enumerate(message)) % 256
    with pytest.raises(DecodeError, match="MIP field"):
        decode_packet(message + bytes((low, high)))
    assert read(message + bytes((low, high)), counters=counters) == []
    assert counters.bad_messages == 1


def test_fields_that_are_too_long() -> None:
    with pytest.raises(ValueError, match="256 bytes"):
        encode_packet(0x80, [Field(1, bytes(126)), Field(2, bytes(126))])

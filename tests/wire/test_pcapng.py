"""Captures in pcapng format: round trips, other byte order and resolutions, damaged files."""

from __future__ import annotations

import shutil
import struct
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.pcapng import (
    Capture,
    Direction,
    Interface,
    Packet,
    decode_pcapng,
    encode_header,
    encode_packet,
    encode_statistics,
)
from tests.fuzz.fuzz_wire import FRAME
from tests.wire.strategies import u64

packets = st.builds(
    Packet,
    *(u64, st.binary(max_size=100), st.text(max_size=20)),
    direction=st.sampled_from(Direction),
)

# A big-endian section of one Ethernet interface (microseconds, as no resolution is given), an
# enhanced and a simple packet, from the figures of draft-ietf-opsawg-pcapng.
BIG_ENDIAN = (
    struct.pack(">IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
    + struct.pack(">IIHHII", 1, 20, 1, 0, 0, 20)
    + struct.pack(">IIIIIII", 6, 36, 0, 0, 1_000_007, 3, 60)
    + b"abc\x00"
    + struct.pack(">I", 36)
    + struct.pack(">III", 3, 20, 2)
    + b"de\x00\x00"
    + struct.pack(">I", 20)
)


@given(st.lists(packets, max_size=5), st.text(max_size=10))
def test_round_trip(values, name):
    data = encode_header(name) + b"".join(encode_packet(packet) for packet in values)
    assert decode_pcapng(data) == Capture((Interface(name),), tuple(values))


def test_big_endian_microseconds_and_simple_packets():
    capture = decode_pcapng(BIG_ENDIAN)
    assert capture.interfaces == (Interface(resolution=6),)
    assert capture.packets == (
        Packet(1_000_007_000, b"abc", original_length=60),
        Packet(0, b"de"),
    )


def test_interface_numbers_restart_in_each_section():
    data = encode_header("a") + encode_packet(Packet(1, b"x"))
    data += encode_header("b") + encode_packet(Packet(2, b"y"))
    capture = decode_pcapng(data)
    assert [each.name for each in capture.interfaces] == ["a", "b"]
    assert [each.interface for each in capture.packets] == [0, 1]


@pytest.mark.parametrize(
    ("resolution", "ticks", "time_ns"), [(9, 5, 5), (3, 5, 5_000_000), (0x80 | 10, 1024, 10**9)]
)
def test_resolutions(resolution, ticks, time_ns):
    header = encode_header().replace(bytes([9, 0, 1, 0, 9]), bytes([9, 0, 1, 0, resolution]))
    capture = decode_pcapng(header + encode_packet(Packet(ticks, b"")))
    assert capture.packets[0].time_ns == time_ns


def test_a_truncated_block_is_omitted_and_counted():
    """Such files remain after a program was killed, or if a disk is full."""
    first, second = encode_packet(Packet(1, b"first")), encode_packet(Packet(2, b"second"))
    start = encode_header() + first
    for size in range(len(second)):
        capture = decode_pcapng(start + second[:size])
        assert [packet.data for packet in capture.packets] == [b"first"]
        assert capture.cut == size


def test_other_blocks_are_omitted():
    statistics = encode_statistics(5, received=3, dropped=1)
    assert decode_pcapng(encode_header() + statistics).packets == ()


@given(st.integers(0, len(BIG_ENDIAN) - 1), st.integers(0, 255))
def test_any_wrong_byte_gives_a_value_or_decode_error(place, byte):
    data = BIG_ENDIAN[:place] + bytes([byte]) + BIG_ENDIAN[place + 1 :]
    try:
        capture = decode_pcapng(data)
    except DecodeError:
        return
    assert len(capture.packets) <= 2


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"\x00" * 11, "needs 12 bytes, received 11"),
        (b"\x01" * 12, "does not begin with a section header"),
        (encode_header()[:20], "block at byte 0 has an invalid length"),
        (encode_header() + struct.pack("<III", 6, 13, 13), "length of 13 bytes"),
        (encode_header()[:8] + b"abcd" + encode_header()[12:], "byte-order magic"),
        (encode_header()[:28] + encode_packet(Packet(0, b"")), "interface 0"),
        (encode_header()[:-4] + bytes(4), "has two different lengths"),
    ],
)
def test_errors_name_the_reason(data, reason):
    with pytest.raises(DecodeError, match=reason):
        decode_pcapng(data)


@pytest.mark.parametrize(
    "packet",
    [
        Packet(-1, b""),
        Packet(1 << 64, b""),
        Packet(0, b"abc", original_length=2),
        Packet(0, b"", interface=1),
        Packet(0, b"", "x" * 70000),
    ],
)
def test_values_that_do_not_fit_are_refused(packet):
    with pytest.raises(ValueError, match="pcapng"):
        encode_packet(packet)


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_reads_what_we_write(tmp_path):
    path = tmp_path / "written.pcapng"
    packet = Packet(1_700_000_000_123_456_789, FRAME, "two datagrams")
    path.write_bytes(encode_header("eth0") + encode_packet(packet))
    fields = ("frame.time_epoch", "frame.comment", "ecat.cmd", "ecat.ado", "_ws.malformed")
    options = [part for field in fields for part in ("-e", field)]
    done = subprocess.run(
        ["tshark", "-r", str(path), "-T", "fields", *options],
        capture_output=True,
        text=True,
        check=True,
    )
    time, comment, commands, offsets, malformed = done.stdout.rstrip("\n").split("\t")
    assert time == "1700000000.123456789"
    assert comment == "two datagrams"
    assert [int(each, 0) for each in commands.split(",")] == [4, 4]
    assert [int(each, 0) for each in offsets.split(",")] == [0x130, 0x130]
    assert malformed == ""

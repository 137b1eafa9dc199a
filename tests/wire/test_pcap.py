"""Captures in pcap format: both byte orders, both time units, truncated files."""

from __future__ import annotations

import contextlib
import shutil
import struct
import subprocess

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.capture import decode_capture
from catenary.wire.pcap import decode_pcap, is_pcap
from catenary.wire.pcapng import Capture, Interface, Packet, encode_header, encode_packet
from tests.fuzz.fuzz_wire import FRAME

MICROSECONDS, NANOSECONDS = 0xA1B2C3D4, 0xA1B23C4D


def pcap(*packets: Packet, order: str = "<", magic: int = MICROSECONDS, tick: int = 1000) -> bytes:
    """Return a file as in draft-ietf-opsawg-pcap, with link type 1 and a check sequence flag."""
    data = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 262144, 0x2400_0001)
    for packet in packets:
        seconds, rest = divmod(packet.time_ns, 1_000_000_000)
        size = len(packet.data)
        original = size if packet.original_length is None else packet.original_length
        data += struct.pack(order + "4I", seconds, rest // tick, size, original) + packet.data
    return data


PACKETS = (
    Packet(1_700_000_000_123_456_000, FRAME),
    Packet(1_700_000_000_123_999_000, b"abc", original_length=60),
)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    ("magic", "tick", "resolution"), [(MICROSECONDS, 1000, 6), (NANOSECONDS, 1, 9)]
)
def test_both_byte_orders_and_time_units(
    order: str, magic: int, tick: int, resolution: int
) -> None:
    data = pcap(*PACKETS, order=order, magic=magic, tick=tick)
    assert decode_pcap(data) == Capture((Interface(resolution=resolution),), PACKETS)


def test_a_truncated_record_is_omitted_and_counted() -> None:
    whole = pcap(PACKETS[0])
    for size in range(len(whole), len(pcap(*PACKETS))):
        capture = decode_pcap(pcap(*PACKETS)[:size])
        assert capture.packets == PACKETS[:1]
        assert capture.cut == size - len(whole)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "magic number missing"),
        (b"\x0a\x0d\x0d\x0a", "magic number 0a0d0d0a"),
        (pcap()[:23], "needs 24 bytes, received 23"),
    ],
)
def test_errors_name_the_reason(data: bytes, reason: str) -> None:
    with pytest.raises(DecodeError, match=reason):
        decode_pcap(data)


@given(st.binary(max_size=80))
def test_any_bytes_after_the_header_give_a_capture(rest: bytes) -> None:
    assert is_pcap(pcap() + rest)
    if len(rest) >= 16 and int.from_bytes(rest[8:12], "little") > 1 << 24:
        with pytest.raises(DecodeError, match="has a length of"):
            decode_pcap(pcap() + rest)
        return
    with contextlib.suppress(DecodeError):  # a later record may be as long
        assert decode_pcap(pcap() + rest).cut <= len(rest)


def test_a_capture_is_read_in_either_format() -> None:
    packet = Packet(5_000, FRAME)
    assert decode_capture(pcap(packet)).packets == (packet,)
    assert decode_capture(encode_header() + encode_packet(packet)).packets == (packet,)
    with pytest.raises(DecodeError, match="pcapng") as refused:
        decode_capture(b"no capture at all")
    assert "tcpdump -w" in refused.value.hint


@pytest.mark.skipif(shutil.which("editcap") is None, reason="editcap is not installed")
def test_a_conversion_by_wireshark_is_equal(tmp_path) -> None:  # type: ignore[no-untyped-def]
    source, converted = tmp_path / "a.pcapng", tmp_path / "a.pcap"
    source.write_bytes(encode_header() + b"".join(map(encode_packet, PACKETS)))
    subprocess.run(["editcap", "-F", "nsecpcap", source, converted], check=True)
    assert decode_capture(converted.read_bytes()).packets == PACKETS

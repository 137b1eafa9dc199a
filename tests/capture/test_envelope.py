"""EtherCAT frames in VLAN, UDP, probes and Linux captures; other protocols are skipped."""

from __future__ import annotations

import struct
import subprocess
from pathlib import Path

import pytest

from catenary.capture.envelope import LINUX_COOKED, LINUX_COOKED_2, unwrap
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import decode_frame, encode_frame
from catenary.wire.pcapng import ETHERNET, Direction, Packet

FRAME = encode_frame([Datagram(EcatCommand.BRD, 0x0130_0000, bytes(2), 7)])
ADDRESSES, REST = FRAME[:12], FRAME[14:]
ETHERTYPE = b"\x88\xa4"
TAG = b"\x81\x00\x00\x05"


def udp(payload: bytes, port: int = 0x88A4) -> bytes:
    size = 28 + len(payload)
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, size, 1, 0, 64, 17, 0, b"\x0a\0\0\1", b"\xff" * 4)
    return ip + struct.pack(">HHHH", 0x88A4, port, 8 + len(payload), 0) + payload


ON_ETHERNET = {
    "plain": FRAME,
    "VLAN": ADDRESSES + TAG + ETHERTYPE + REST,
    "QinQ": ADDRESSES + b"\x88\xa8\x00\x07" + TAG + ETHERTYPE + REST,
    "UDP": ADDRESSES + b"\x08\x00" + udp(REST),
    "UDP in VLAN": ADDRESSES + TAG + b"\x08\x00" + udp(REST),
}
SWITCH_LINK = b"\x01\x01\x05\x10\x00\x00" + bytes(10) + FRAME


@pytest.mark.parametrize("data", [*ON_ETHERNET.values(), SWITCH_LINK])
def test_frames_on_ethernet(data: bytes) -> None:
    found = unwrap(Packet(0, data), ETHERNET)
    assert found is not None
    assert decode_frame(found.frame) == decode_frame(FRAME)


@pytest.mark.parametrize(("link_type", "prefix"), [(240, 4), (241, 12), (274, 8)])
def test_probes_put_bytes_before_the_frame(link_type: int, prefix: int) -> None:
    found = unwrap(Packet(0, bytes(prefix) + FRAME + b"\x12\x34\x56\x78"), link_type)
    assert found is not None
    assert decode_frame(found.frame).datagrams == decode_frame(FRAME).datagrams


@pytest.mark.parametrize(
    ("packet_type", "direction"), [(4, Direction.OUTBOUND), (1, Direction.INBOUND)]
)
def test_linux_cooked_captures(packet_type: int, direction: Direction) -> None:
    source = FRAME[6:12] + bytes(2)
    first = struct.pack(">HHH", packet_type, 1, 6) + source + ETHERTYPE + REST
    second = ETHERTYPE + struct.pack(">HIHBB", 0, 3, 1, packet_type, 6) + source + REST
    for data, link_type in ((first, LINUX_COOKED), (second, LINUX_COOKED_2)):
        found = unwrap(Packet(0, data), link_type)
        assert found is not None
        assert found.direction is direction
        assert decode_frame(found.frame).source == FRAME[6:12]


@pytest.mark.parametrize(
    "data",
    [
        b"",
        FRAME[:13],
        ADDRESSES + b"\x08\x06" + REST,
        ADDRESSES + b"\x08\x00",
        ADDRESSES + b"\x08\x00" + udp(REST, port=53)[:20] + struct.pack(">HH", 5, 53) + bytes(40),
        ADDRESSES + TAG * 5 + ETHERTYPE + REST,
    ],
)
def test_other_protocols_are_skipped(data: bytes) -> None:
    assert unwrap(Packet(0, data), ETHERNET) is None


def test_other_link_types_are_skipped() -> None:
    assert unwrap(Packet(0, FRAME), 101) is None


def test_a_frame_check_sequence_is_removed_from_a_long_frame() -> None:
    longest = encode_frame([Datagram(EcatCommand.LRW, 0, bytes(1486))])
    found = unwrap(Packet(0, longest + b"\x01\x02\x03\x04"), ETHERNET)
    assert found is not None
    assert found.frame == longest


def test_tshark_finds_the_same_datagrams(tshark: str, tmp_path: Path) -> None:
    path = tmp_path / "envelopes.pcap"
    records = [
        struct.pack("<4I", 0, i, len(d), len(d)) + d for i, d in enumerate(ON_ETHERNET.values())
    ]
    path.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1) + b"".join(records))
    command = [tshark, "-r", str(path), "-T", "fields", "-e", "ecat.cmd", "-e", "ecat.idx"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["0x07\t0x07"] * len(ON_ETHERNET)

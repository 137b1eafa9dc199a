"""Frames of the mailbox gateway: golden bytes, streams, invalid bytes, and tshark."""

from __future__ import annotations

import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.gateway import MAXIMUM_LENGTH, PORT, decode_gateway, encode_gateway, frame_size
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.pcapng import Packet, encode_header, encode_packet

# Beckhoff's TwinSAFE Loader and the gateway of IgH's master: etherlab-dev, 7 April 2021
# ("Ethercat mailbox gateway and TwinSAFE loader issues"), recorded with tcpdump.
GOLDEN = {
    "10500a00e903002300204180f90200000000": Mailbox(
        Type.COE, bytes.fromhex("00204180f90200000000"), 2, 0x03E9
    ),
    "10500a00e903001300304380f902ea821e00": Mailbox(
        Type.COE, bytes.fromhex("00304380f902ea821e00"), 1, 0x03E9
    ),
    "10500a00e903003300204180f90100000000": Mailbox(
        Type.COE, bytes.fromhex("00204180f90100000000"), 3, 0x03E9
    ),
}
# The same capture: header of an answer of 256 bytes
LONG_HEADER = bytes.fromhex("0051")


@pytest.mark.parametrize(("encoded", "message"), GOLDEN.items())
def test_golden_bytes(encoded: str, message: Mailbox) -> None:
    assert message.encode() == bytes.fromhex(encoded)[2:]
    assert encode_gateway(message) == bytes.fromhex(encoded)
    assert decode_gateway(bytes.fromhex(encoded)) == message


def test_the_length_includes_the_mailbox_header() -> None:
    message = Mailbox(Type.COE, bytes(0xFA), 3, 0x03E9)
    assert encode_gateway(message)[:2] == LONG_HEADER
    assert frame_size(LONG_HEADER) == 2 + 6 + 0xFA


@given(st.builds(Mailbox, st.sampled_from(Type), st.binary(max_size=2041), st.integers(0, 7)))
def test_every_message_is_decoded_again(message: Mailbox) -> None:
    frame = encode_gateway(message)
    assert frame_size(frame) == len(frame)
    assert decode_gateway(frame) == message
    assert decode_gateway(frame + b"rest") == message


@given(st.binary(max_size=80))
def test_random_bytes_are_decoded_or_refused(data: bytes) -> None:
    try:
        message = decode_gateway(data)
    except DecodeError:
        return
    assert len(encode_gateway(message)) <= len(data)


def test_the_longest_message() -> None:
    frame = encode_gateway(Mailbox(Type.FOE, bytes(MAXIMUM_LENGTH - 6)))
    assert frame[:2] == b"\xff\x57"
    with pytest.raises(ValueError, match="exceeds the 2047 bytes"):
        encode_gateway(Mailbox(Type.FOE, bytes(MAXIMUM_LENGTH - 5)))


@pytest.mark.parametrize("text", ["", "10", "1050", "10500a00e903002300204180f902000000"])
def test_a_truncated_frame(text: str) -> None:
    with pytest.raises(DecodeError, match="gateway"):
        decode_gateway(bytes.fromhex(text))


@pytest.mark.parametrize(
    "header",
    [0x1010, 0x4010, 0x5810, 0x5005, 0x5000, struct.unpack("<H", b"GE")[0]],
    ids=["commands", "type 4", "reserved bit", "short", "empty", "HTTP"],
)
def test_a_header_that_is_not_of_the_gateway(header: int) -> None:
    with pytest.raises(DecodeError, match="gateway"):
        frame_size(struct.pack("<H", header) + bytes(100))


def test_a_lying_length_of_the_mailbox() -> None:
    with pytest.raises(DecodeError, match="specifies 200 bytes"):
        decode_gateway(struct.pack("<HHHBB", 0x5006 + 4, 200, 1, 0, 3) + bytes(300))


def datagram(payload: bytes, protocol: int, sequence: int) -> bytes:
    """Return an Ethernet frame with a UDP datagram or a TCP segment."""
    if protocol == 17:
        head = struct.pack(">HHHH", 50000, PORT, 8 + len(payload), 0)
    else:
        head = struct.pack(">HHIIBBHHH", 50000, PORT, sequence, 1, 5 << 4, 0x18, 8192, 0, 0)
    size = 20 + len(head) + len(payload)
    loopback = bytes((127, 0, 0, 1))
    address = struct.pack(">BBHHHBBH", 0x45, 0, size, 0, 0, 64, protocol, 0) + loopback * 2
    return bytes(12) + b"\x08\x00" + address + head + payload


@pytest.mark.parametrize("protocol", [17, 6], ids=["UDP", "TCP"])
def test_tshark_reads_the_same_fields(tshark: str, tmp_path: Path, protocol: int) -> None:
    path = tmp_path / "gateway.pcapng"
    packets = [
        Packet(0, datagram(encode_gateway(message), protocol, 1 + 18 * number))
        for number, message in enumerate(GOLDEN.values())
    ]
    path.write_bytes(encode_header("lo") + b"".join(map(encode_packet, packets)))
    names = ("ecatf.type", "ecatf.length", "ecat_mailbox.address", "ecat_mailbox.counter")
    options = [part for name in (*names, "_ws.malformed") for part in ("-e", name)]
    command = [tshark, "-r", str(path), "-T", "fields", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert [line.split("\t") for line in done.stdout.splitlines()] == [
        ["0x0005", "0x0010", "0x03e9", str(message.counter), ""] for message in GOLDEN.values()
    ]

"""SoE: messages, fragments, and bytes that are not valid."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.frame import encode_frame
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.pcapng import Packet, encode_header, encode_packet
from catenary.wire.soe import Element, Message, OpCode, decode_soe
from tests.wire.strategies import u16

messages = st.builds(
    Message,
    st.sampled_from(OpCode),
    u16,
    st.integers(0, 255).map(Element),
    st.binary(max_size=40),
    drive=st.integers(0, 7),
    incomplete=st.booleans(),
    error=st.booleans(),
)

# From the tables of ETG.1000.6 §5.9; the bit fields are those of SOEM (ec_soe.c, ec_SoEt).
GOLDEN = {
    "01402f00": Message(OpCode.READ_REQUEST, 47, Element.VALUE),
    "02402f0040e20100": Message(
        OpCode.READ_RESPONSE, 47, Element.VALUE, (123456).to_bytes(4, "little")
    ),
    "0a4002000400ffff": Message(
        OpCode.READ_RESPONSE, 2, Element.VALUE, bytes.fromhex("0400ffff"), incomplete=True
    ),
    "234020000b00": Message(OpCode.WRITE_REQUEST, 32, Element.VALUE, b"\x0b\x00", drive=1),
    "0440 2000".replace(" ", ""): Message(OpCode.WRITE_RESPONSE, 32, Element.VALUE),
    "124001800110": Message(OpCode.READ_RESPONSE, 0x8001, Element.VALUE, b"\x01\x10", error=True),
    "050163000300": Message(OpCode.NOTIFICATION, 99, Element.STATE, b"\x03\x00"),
    "0600000000100100": Message(OpCode.EMERGENCY, 0, data=bytes.fromhex("00100100")),
}


@pytest.mark.parametrize("encoded", GOLDEN)
def test_golden_bytes(encoded: str) -> None:
    message = GOLDEN[encoded]
    assert message.encode().hex() == encoded
    assert decode_soe(bytes.fromhex(encoded)) == message


@given(messages)
def test_a_message_survives_its_encoding(message: Message) -> None:
    assert decode_soe(message.encode()) == message


@given(st.binary(max_size=60))
def test_any_bytes_give_a_message_or_an_error(data: bytes) -> None:
    try:
        message = decode_soe(data)
    except DecodeError:
        return
    assert message.encode() == data


@pytest.mark.parametrize("data", ["", "014000", "00402f00", "07402f00"])
def test_bytes_that_are_not_valid_are_refused(data: str) -> None:
    with pytest.raises(DecodeError, match="SoE"):
        decode_soe(bytes.fromhex(data))


def test_the_error_code_is_at_the_end() -> None:
    assert decode_soe(bytes.fromhex("1240018001020304" + "0570")).code == 0x7005
    assert decode_soe(bytes.fromhex("124001800570")).code == 0x7005
    assert decode_soe(bytes.fromhex("1240018005")).code == 0
    assert decode_soe(bytes.fromhex("024001800570")).code == 0


@pytest.mark.parametrize(
    "message",
    [
        Message(OpCode.READ_REQUEST, 1 << 16),
        Message(OpCode.READ_REQUEST, -1),
        Message(OpCode.READ_REQUEST, 1, drive=8),
    ],
)
def test_fields_that_do_not_fit_are_refused(message: Message) -> None:
    with pytest.raises(ValueError, match="SoE"):
        message.encode()


def test_tshark_reads_the_same_fields(tshark: str, tmp_path: Path) -> None:
    """Let Wireshark's dissector judge the encoder.

    Version 4.0 shows the IDN as the error code (packet-ecatmb.c).
    """
    path = tmp_path / "soe.pcapng"
    frames = [
        encode_frame([Datagram(EcatCommand.FPWR, 0x1000_1001, _mailbox(each.encode()), 1, 1)])
        for each in GOLDEN.values()
    ]
    path.write_bytes(
        encode_header("eth0") + b"".join(encode_packet(Packet(0, frame)) for frame in frames)
    )
    names = (
        *("opcode", "header_incomplete", "header_error", "header_driveno", "header_datastate"),
        *("header_value", "idn", "frag", "error"),
    )
    options = [part for name in names for part in ("-e", f"ecat_mailbox.soe_{name}")]
    done = subprocess.run(
        [tshark, "-r", str(path), "-T", "fields", *options, "-e", "_ws.malformed"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert [line.split("\t") for line in done.stdout.splitlines()] == [
        ["1", "0", "0", "0", "0", "1", "0x002f", "", "", ""],
        ["2", "0", "0", "0", "0", "1", "0x002f", "", "", ""],
        ["2", "1", "0", "0", "0", "1", "", "0x0002", "", ""],
        ["3", "0", "0", "1", "0", "1", "0x0020", "", "", ""],
        ["4", "0", "0", "0", "0", "1", "0x0020", "", "", ""],
        ["2", "0", "1", "0", "0", "1", "0x8001", "", "0x8001", ""],
        ["5", "0", "0", "0", "1", "0", "0x0063", "", "", ""],
        ["6", "0", "0", "0", "0", "0", "", "", "", ""],
    ]


def _mailbox(data: bytes) -> bytes:
    return Mailbox(Type.SOE, data, 1).encode(64)

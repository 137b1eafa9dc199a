"""FoE: the six messages, error codes, and bytes that are not valid."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.datagram import Datagram, EcatCommand
from catenary.wire.foe import (
    ERRORS,
    UNKNOWN_ERROR,
    Acknowledge,
    Busy,
    Data,
    Error,
    ErrorCode,
    ReadRequest,
    WriteRequest,
    decode_foe,
    error_meaning,
)
from catenary.wire.frame import encode_frame
from catenary.wire.mailbox import Mailbox, Type
from catenary.wire.pcapng import Packet, encode_header, encode_packet
from tests.wire.strategies import u16, u32

names = st.text(st.characters(min_codepoint=1, max_codepoint=0xFF), max_size=30)
messages = st.one_of(
    *(st.builds(kind, names, u32) for kind in (ReadRequest, WriteRequest)),
    st.builds(Data, u32, st.binary(max_size=40)),
    st.builds(Acknowledge, u32),
    st.builds(Error, u32, names),
    st.builds(Busy, u16, u16, names),
)

# From the tables of ETG.1000.6 §5.8.2 to §5.8.7.
GOLDEN = {
    "0100000000006c6f672e747874": ReadRequest("log.txt"),
    "0200341200006170702e656677": WriteRequest("app.efw", 0x1234),
    "030001000000deadbeef": Data(1, bytes.fromhex("deadbeef")),
    "030002000100": Data(0x10002, b""),  # the empty last packet
    "040000000000": Acknowledge(0),
    "050003800000": Error(ErrorCode.DISK_FULL),
    "05000a8000006e6f": Error(ErrorCode.NO_RIGHTS, "no"),
    "06001e0064006572617365": Busy(30, 100, "erase"),
}


@pytest.mark.parametrize("encoded", GOLDEN)
def test_golden_bytes(encoded: str):
    message = GOLDEN[encoded]
    assert message.encode().hex() == encoded
    assert decode_foe(bytes.fromhex(encoded)) == message


@given(messages)
def test_every_message_survives_a_round_trip(message):
    assert decode_foe(message.encode()) == message


@given(st.binary(max_size=40))
def test_any_bytes_give_a_message_or_decode_error(data: bytes):
    try:
        message = decode_foe(data)
    except DecodeError:
        return
    assert decode_foe(message.encode()) == message


def test_the_reserved_byte_is_ignored():
    # IgH writes the op-code with 16 bits, other masters may write anything there.
    assert decode_foe(bytes.fromhex("04ff05000000")) == Acknowledge(5)


def test_a_terminator_and_padding_are_not_part_of_the_text():
    assert decode_foe(bytes.fromhex("050001800000") + b"no such file\0\0") == Error(
        0x8001, "no such file"
    )


@pytest.mark.parametrize("data", ["", "0100000000", "070000000000", "000000000000"])
def test_short_messages_and_unknown_op_codes_are_refused(data: str):
    with pytest.raises(DecodeError, match="FoE"):
        decode_foe(bytes.fromhex(data))


@pytest.mark.parametrize(
    "message",
    [
        ReadRequest("a", 1 << 32),
        WriteRequest("a", -1),
        ReadRequest("漢"),
        Data(1 << 32, b""),
        Busy(1 << 16),
        Error(-1),
    ],
)
def test_fields_that_do_not_fit_are_refused(message):
    with pytest.raises(ValueError, match="FoE"):
        message.encode()


def test_every_error_code_has_a_text():
    assert set(ERRORS) == set(ErrorCode)
    assert all(meaning.text for meaning in ERRORS.values())
    assert error_meaning(0x8001).text == "file not found"
    assert error_meaning(0x38020001) is UNKNOWN_ERROR


def test_bit_15_of_an_error_code_may_be_missing():
    assert error_meaning(0x0001) is error_meaning(0x8001)


def test_tshark_reads_the_same_fields(tshark: str, tmp_path: Path):
    """Let Wireshark's dissector judge the encoder.

    It shows the password as a file length, and 16 bits of a packet number.
    """
    path = tmp_path / "foe.pcapng"
    frames = [
        encode_frame([Datagram(EcatCommand.FPWR, 0x1000_1001, _mailbox(each.encode()), 1, 1)])
        for each in GOLDEN.values()
    ]
    path.write_bytes(
        encode_header("eth0") + b"".join(encode_packet(Packet(0, frame)) for frame in frames)
    )
    fields = ("opmode", "filelength", "filename", "packetno", "errcode", "busydone", "busyentire")
    options = [part for name in fields for part in ("-e", f"ecat_mailbox.foe_{name}")]
    done = subprocess.run(
        [tshark, "-r", str(path), "-T", "fields", *options, "-e", "_ws.malformed"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert [line.split("\t") for line in done.stdout.splitlines()] == [
        ["0x01", "0", "log.txt", "", "", "", "", ""],
        ["0x02", "4660", "app.efw", "", "", "", "", ""],
        ["0x03", "", "", "1", "", "", "", ""],
        ["0x03", "", "", "2", "", "", "", ""],
        ["0x04", "", "", "0", "", "", "", ""],
        ["0x05", "", "", "", "32771", "", "", ""],
        ["0x05", "", "", "", "32778", "", "", ""],
        ["0x06", "", "", "", "", "0x001e", "0x0064", ""],
    ]


def _mailbox(data: bytes) -> bytes:
    return Mailbox(Type.FOE, data, 1).encode(64)

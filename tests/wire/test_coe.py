"""CoE: all forms of SDO services, emergency."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.coe import (
    Abort,
    DownloadRequest,
    DownloadResponse,
    DownloadSegment,
    DownloadSegmentResponse,
    Emergency,
    UploadRequest,
    UploadResponse,
    UploadSegment,
    UploadSegmentRequest,
    decode_coe,
)
from catenary.wire.sdo_information import SdoInformation
from tests.wire.strategies import flag, u8, u16, u32


@st.composite
def initiates(draw, kind):
    expedited = draw(flag)
    data = draw(st.binary(min_size=1, max_size=4) if expedited else st.binary(max_size=50))
    size = len(data) if expedited else draw(st.integers(len(data), 0xFFFF_FFFF))
    return kind(draw(u16), draw(u8), data, size, expedited, draw(flag))


messages = st.one_of(
    *(initiates(DownloadRequest), initiates(UploadResponse)),
    *(st.builds(DownloadResponse, u16, u8, flag), st.builds(UploadRequest, u16, u8, flag)),
    *(
        st.builds(kind, flag, flag, st.binary(max_size=40))
        for kind in (DownloadSegment, UploadSegment)
    ),
    *(st.builds(kind, flag) for kind in (DownloadSegmentResponse, UploadSegmentRequest)),
    st.builds(Abort, u16, u8, u32),
    st.builds(Emergency, u16, u8, st.binary(min_size=5, max_size=5)),
)

GOLDEN = {
    # ethercrab's tests/replay-ek1914-el3004-configure.pcapng: 0x1C12:0 := 0 and its answer; 1C13
    "00202f121c0000000000": DownloadRequest(0x1C12, 0, b"\x00", 1, expedited=True),
    "003060121c0000000000": DownloadResponse(0x1C12, 0),
    "00202b131c01001a0000": DownloadRequest(0x1C13, 1, b"\x00\x1a", 2, expedited=True),
    "002040131c0100000000": UploadRequest(0x1C13, 1),
    # ethercrab's tests/replay-ek1914-segmented-upload.pcapng: 0x1008, one normal upload
    "00304108100006000000454b31393134": UploadResponse(0x1008, 0, b"EK1914", 6),
    # from the bit tables of ETG.1000.6 §5.6.2
    "00304200100100000000": UploadResponse(0x1000, 1, bytes(4), 4, expedited=True),  # no size
    "00203100160009000000020010004060": DownloadRequest(
        0x1600, 0, bytes.fromhex("020010004060"), 9, complete_access=True
    ),
    "00206000000000000000": UploadSegmentRequest(toggle=False),
    "00207000000000000000": UploadSegmentRequest(toggle=True),
    "00300041424344454647": UploadSegment(toggle=False, last=False, data=b"ABCDEFG"),
    "00301941424300000000": UploadSegment(toggle=True, last=True, data=b"ABC"),
    "00200b41420000000000": DownloadSegment(toggle=False, last=True, data=b"AB"),
    "00303000000000000000": DownloadSegmentResponse(toggle=True),
    "00208018100100000206": Abort(0x1018, 1, 0x06020000),
    "00101086210102030405": Emergency(0x8610, 0x21, b"\x01\x02\x03\x04\x05"),
}


@pytest.mark.parametrize(("data", "message"), GOLDEN.items())
def test_golden_bytes(data, message):
    assert decode_coe(bytes.fromhex(data)) == message


@pytest.mark.parametrize(
    ("data", "message"),
    [(data, message) for data, message in GOLDEN.items() if data[4:6] != "42"],
)
def test_golden_bytes_are_encoded(data, message):
    assert message.encode() == bytes.fromhex(data)


@given(messages)
def test_round_trip(message):
    assert decode_coe(message.encode()) == message


@given(
    st.sampled_from((b"\x00\x10", b"\x00\x20", b"\x00\x30", b"\x00\x80")), st.binary(max_size=60)
)
def test_any_bytes_give_a_value_or_decode_error(header, data):
    try:
        message = decode_coe(header + data)
    except DecodeError:
        return
    assert decode_coe(message.encode()) == message


@given(st.integers(0, 20), flag)
def test_a_short_segment_is_padded(size, last):
    encoded = UploadSegment(False, last, bytes(size)).encode()
    assert len(encoded) == 3 + max(size, 7)
    assert encoded[2] >> 1 & 7 == max(7 - size, 0)


def test_bytes_after_the_complete_size_are_ignored():
    data = UploadResponse(0x1008, 0, b"abc", 3).encode() + b"stale"
    assert decode_coe(data) == UploadResponse(0x1008, 0, b"abc", 3)


def test_an_abort_in_a_response_is_decoded():
    data = Abort(0x1018, 1, 0x06090011).encode()
    assert decode_coe(b"\x00\x30" + data[2:]) == Abort(0x1018, 1, 0x06090011)


def test_sdo_information_is_decoded():
    assert isinstance(decode_coe(bytes.fromhex("0080010000000100")), SdoInformation)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        ("00", "needs 2 bytes, received 1"),
        ("0050" + "00" * 8, "service 5 is not supported"),
        ("0020" + "40181001", "SDO: needs 10 bytes, received 6"),
        ("0020a0" + "00" * 7, "unknown command specifier 5"),
        ("0030e0" + "00" * 7, "unknown command specifier 7"),
        ("001010862101", "emergency: needs 10 bytes"),
    ],
)
def test_errors_name_the_reason(data, reason):
    with pytest.raises(DecodeError, match=reason):
        decode_coe(bytes.fromhex(data))


@pytest.mark.parametrize(
    "message",
    [
        DownloadRequest(0x10000, 0, b"x", 1),
        DownloadRequest(0, 0, b"", 0, expedited=True),
        DownloadRequest(0, 0, b"12345", 5, expedited=True),
        DownloadRequest(0, 0, b"1", 2, expedited=True),
        UploadResponse(0, 0, b"12", 1),
        UploadResponse(0, 0, b"", 1 << 32),
        UploadRequest(0, 256),
        Abort(0, 0, 1 << 32),
        Emergency(0, 0, b""),
        Emergency(0x10000, 0),
    ],
)
def test_values_that_do_not_fit_are_refused(message):
    with pytest.raises(ValueError, match=r"SDO|emergency"):
        message.encode()

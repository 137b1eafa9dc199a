"""Messages of the diagnosis history (0x10F3).

No dissector decodes these objects. The golden bytes follow the tables of ETG.1020 §13 and what
other implementations document.
"""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.diagnosis_history import (
    _FORMATS,
    DiagnosisMessage,
    DiagnosisType,
    Parameter,
    ParameterKind,
    decode_diagnosis_message,
    is_empty,
)
from tests.wire.strategies import flag, u16, u32


def number(value: int, data_type: int = 0x0005, size: int = 1) -> Parameter:
    return Parameter(ParameterKind.NUMBER, value.to_bytes(size, "little"), data_type)


GOLDEN = {
    # Festo, manual of CPX-E-EC, example of a diagnostic message: an error with two bytes
    "020000e1020202371fc59d613100000005000205 0080": DiagnosisMessage(
        0xE100_0002,
        DiagnosisType.ERROR,
        0x3702,
        0x31_619D_C51F,
        parameters=(number(2), number(0x80)),
    ),
    # Beckhoff, ELM3xxx, sample program 8: DiagCode "00E02150", parameters "05003C050089"
    "00e021501202073000000000000000000500 3c 0500 89": DiagnosisMessage(
        0x5021_E000,
        DiagnosisType.ERROR,
        0x3007,
        0,
        local_time=True,
        parameters=(number(0x3C), number(0x89)),
    ),
    # Slave stack code (ecatappl.c): SyncManager settings, an emergency code, UINT8 and UINT16
    "00e800a0020205000100000000000000 0500 02 0600 2600": DiagnosisMessage(
        0xA000_E800,
        DiagnosisType.ERROR,
        5,
        1,
        parameters=(number(2), number(0x26, 0x0006, 2)),
    ),
    # ETG.1020 table of the parameter flags: bytes, ASCII, Unicode, a text ID
    "01e00000 0104 0000 0000000000000000 0310010203 0220 4f4b 0430 41004200 0240 0700": (
        DiagnosisMessage(
            0xE001,
            DiagnosisType.WARNING,
            0,
            0,
            parameters=(
                Parameter(ParameterKind.BYTES, b"\1\2\3"),
                Parameter(ParameterKind.ASCII, b"OK"),
                Parameter(ParameterKind.UNICODE, "AB".encode("utf-16-le")),
                Parameter(ParameterKind.TEXT_ID, b"\7\0"),
            ),
        )
    ),
}


@pytest.mark.parametrize("data", GOLDEN)
def test_golden_bytes(data: str) -> None:
    raw = bytes.fromhex(data)
    assert decode_diagnosis_message(raw) == GOLDEN[data]
    assert GOLDEN[data].encode() == raw


def test_values_of_parameters() -> None:
    found = decode_diagnosis_message(bytes.fromhex(list(GOLDEN)[3])).parameters
    assert [each.value for each in found] == [b"\1\2\3", "OK", "AB", 7]
    assert Parameter(ParameterKind.NUMBER, struct.pack("<h", -5), 0x0003).value == -5
    assert Parameter(ParameterKind.NUMBER, struct.pack("<f", 0.5), 0x0008).value == 0.5
    assert Parameter(ParameterKind.NUMBER, b"\1", 0x0001).value == 1


def test_zeros_after_a_message_are_dropped() -> None:
    """Beckhoff's terminals have messages of a fixed size: OCTET-STRING[20], [22] or [32]."""
    data, message = next(iter(GOLDEN.items()))
    assert decode_diagnosis_message(bytes.fromhex(data).ljust(32, b"\0")) == message


def test_an_emergency_code_is_in_the_high_word() -> None:
    assert DiagnosisMessage(0x8611_E800, 2, 0, 0).error_code == 0x8611
    assert DiagnosisMessage(0x8611_E000, 2, 0, 0).error_code is None


@pytest.mark.parametrize("size", range(16))
def test_a_short_message_is_an_error(size: int) -> None:
    with pytest.raises(DecodeError, match="needs 16 bytes"):
        decode_diagnosis_message(bytes(size))


@pytest.mark.parametrize(
    "tail",
    [
        "0500",  # no value
        "0600 01",  # half a value
        "0900 41",  # VISIBLE_STRING has no length
        "ff2f 41",  # 4095 characters
        "0050 00",  # reserved kind
    ],
)
def test_a_faulty_parameter_ends_the_list(tail: str) -> None:
    raw = bytes.fromhex("00e00000 0202 0000 0000000000000000 0500 07") + bytes.fromhex(tail)
    found = decode_diagnosis_message(raw)
    assert [each.value for each in found.parameters] == [7]
    assert found.count == 2


def test_255_announced_parameters_need_no_more_than_the_data() -> None:
    raw = bytes.fromhex("00e00000 02ff 0000 0000000000000000 0500 07")
    assert len(decode_diagnosis_message(raw).parameters) == 1


def test_empty_subindices() -> None:
    assert is_empty(b"")
    assert is_empty(bytes(20))
    assert not is_empty(bytes.fromhex(next(iter(GOLDEN))))


@pytest.mark.parametrize(
    "parameter",
    [
        Parameter(ParameterKind.NUMBER, b"\0", 0x0006),
        Parameter(ParameterKind.NUMBER, b"\0", 0x0009),
        Parameter(ParameterKind.BYTES, bytes(4096)),
    ],
)
def test_an_impossible_parameter_is_refused(parameter: Parameter) -> None:
    with pytest.raises(ValueError, match="diagnosis parameter"):
        parameter.encode()


numbers = st.sampled_from(sorted(_FORMATS)).flatmap(
    lambda kind: st.binary(
        min_size=struct.calcsize(_FORMATS[kind]), max_size=struct.calcsize(_FORMATS[kind])
    ).map(lambda data: Parameter(ParameterKind.NUMBER, data, kind))
)
parameters = st.one_of(
    numbers,
    st.binary(max_size=40).map(lambda data: Parameter(ParameterKind.BYTES, data)),
    st.binary(max_size=40).map(lambda data: Parameter(ParameterKind.ASCII, data)),
    st.binary(min_size=2, max_size=2).map(lambda data: Parameter(ParameterKind.TEXT_ID, data)),
)
messages = st.builds(
    DiagnosisMessage,
    u32,
    st.integers(0, 15),
    u16,
    st.integers(0, 2**64 - 1),
    flag,
    st.lists(parameters, max_size=8).map(tuple),
)


@given(messages)
def test_round_trip(message: DiagnosisMessage) -> None:
    assert decode_diagnosis_message(message.encode()) == message


@given(st.binary(max_size=80))
def test_any_bytes_are_decoded_or_refused(data: bytes) -> None:
    try:
        found = decode_diagnosis_message(data)
    except DecodeError:
        assert len(data) < 16
        return
    assert decode_diagnosis_message(found.encode()) == found
    for each in found.parameters:
        assert isinstance(each.value, int | float | str | bytes)

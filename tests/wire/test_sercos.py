"""IDNs, attributes, lists, values and error codes of SERCOS drives."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire.sercos import (
    Attribute,
    Display,
    Protection,
    decode_attribute,
    encode_list,
    idn_number,
    idn_text,
    split_list,
)
from catenary.wire.sercos_errors import SPECIAL, error_meaning
from catenary.wire.sercos_values import decode_value, encode_value
from tests.wire.strategies import u16

POSITION = Attribute(4, display=Display.SIGNED)
VELOCITY = Attribute(4, display=Display.SIGNED, decimals=4)
IDNS = Attribute(2, is_list=True, display=Display.IDN)
TEXT = Attribute(1, is_list=True, display=Display.TEXT)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("S-0-0047", 47),
        ("S-0-0000", 0),
        ("P-0-0010", 0x800A),
        ("S-7-4095", 0x7FFF),
        ("P-7-4095", 0xFFFF),
        ("S-1-0032", 0x1020),
    ],
)
def test_the_notation_of_an_idn(text: str, number: int) -> None:
    assert idn_number(text) == number
    assert idn_text(number) == text


@given(u16)
def test_every_number_has_a_notation(number: int) -> None:
    assert idn_number(idn_text(number)) == number == idn_number(number)


def test_short_and_lower_case_notations_are_accepted() -> None:
    assert idn_number("s-0-47") == 47
    assert idn_number(" P-0-10 ") == 0x800A


@pytest.mark.parametrize("idn", ["", "S-8-0001", "S-0-4096", "S-0", "X-0-0001", -1, 1 << 16])
def test_what_is_not_an_idn_is_refused(idn: str | int) -> None:
    with pytest.raises(ValueError, match="IDN"):
        idn_number(idn)


# Words as bit fields of SOEM (ec_soe.h, ec_SoEattributet): factor, length, list, command, data
# type, decimals, write protection.
ATTRIBUTES = {
    "01002200": POSITION,
    "01002204": VELOCITY,
    "01005500": IDNS,
    "01004470": Attribute(
        1,
        is_list=True,
        display=Display.TEXT,
        protection=Protection.PRE_OP | Protection.SAFE_OP | Protection.OP,
    ),
    "01000900": Attribute(2, is_command=True),
    "64001361": Attribute(
        8,
        display=Display.UNSIGNED,
        decimals=1,
        factor=100,
        protection=Protection.SAFE_OP | Protection.OP,
    ),
}


@pytest.mark.parametrize("encoded", ATTRIBUTES)
def test_golden_attributes(encoded: str) -> None:
    assert ATTRIBUTES[encoded].encode().hex() == encoded
    assert decode_attribute(bytes.fromhex(encoded)) == ATTRIBUTES[encoded]


@given(st.binary(min_size=4, max_size=4))
def test_any_word_is_an_attribute(data: bytes) -> None:
    attribute = decode_attribute(data)
    assert decode_attribute(attribute.encode()) == attribute


@pytest.mark.parametrize("data", [b"", b"123", b"12345"])
def test_an_attribute_has_4_bytes(data: bytes) -> None:
    with pytest.raises(DecodeError, match="needs 4 bytes"):
        decode_attribute(data)


def test_fields_of_an_attribute_that_do_not_fit_are_refused() -> None:
    for wrong in (Attribute(3), Attribute(2, decimals=16), Attribute(2, factor=1 << 16)):
        with pytest.raises(ValueError, match="attribute"):
            wrong.encode()


def test_a_list_has_its_length_and_its_maximum() -> None:
    assert encode_list(b"ab", 10) == bytes.fromhex("02000a00") + b"ab"
    assert split_list(bytes.fromhex("02000a00") + b"abrest") == (b"ab", 10, b"rest")


@pytest.mark.parametrize("data", ["", "020004", "0400040061", "0200010061 62"])
def test_a_list_that_lies_about_its_length_is_refused(data: str) -> None:
    with pytest.raises(DecodeError, match="list"):
        split_list(bytes.fromhex(data))


def test_a_list_that_exceeds_its_maximum_is_refused() -> None:
    with pytest.raises(ValueError, match="exceeds its maximum"):
        encode_list(b"abc", 2)
    with pytest.raises(ValueError, match="exceeds its maximum"):
        encode_list(bytes(1 << 16))


@pytest.mark.parametrize(
    ("attribute", "encoded", "value"),
    [
        (POSITION, "ffffffff", -1),
        (VELOCITY, "3a300000", 1.2346),
        (VELOCITY, "c6cfffff", -1.2346),
        (Attribute(2, display=Display.UNSIGNED), "ffff", 0xFFFF),
        (Attribute(2, display=Display.UNSIGNED, factor=5, decimals=1), "0700", 3.5),
        (Attribute(2, display=Display.UNSIGNED, factor=0), "0700", 7),
        (Attribute(2, display=Display.HEXADECIMAL), "00c0", 0xC000),
        (Attribute(2, display=Display.IDN), "0a80", "P-0-0010"),
        (Attribute(4, display=Display.FLOAT), "0000c03f", 1.5),
        (Attribute(8, display=Display.FLOAT), "000000000000f83f", 1.5),
        (Attribute(4, display=Display.TEXT), "61620000", "ab"),
        (IDNS, "0400080033000a80", ["S-0-0051", "P-0-0010"]),
        (TEXT, "03000300616263", "abc"),
        (Attribute(2, is_list=True, display=Display.SIGNED), "04000400ffff0100", [-1, 1]),
    ],
)
def test_values(attribute: Attribute, encoded: str, value: object) -> None:
    data = bytes.fromhex(encoded)
    assert decode_value(attribute, data) == value
    maximum = int.from_bytes(data[2:4], "little") if attribute.is_list else None
    assert encode_value(attribute, value, maximum) == data  # type: ignore[arg-type]


@given(st.integers(-(1 << 31), (1 << 31) - 1))
def test_a_scaled_number_survives_its_display(raw: int) -> None:
    data = raw.to_bytes(4, "little", signed=True)
    assert encode_value(VELOCITY, decode_value(VELOCITY, data)) == data


@given(st.binary(min_size=4, max_size=4), st.binary(max_size=20))
def test_any_value_is_decoded_or_refused(word: bytes, data: bytes) -> None:
    attribute = decode_attribute(word)
    try:
        decode_value(attribute, data)
    except DecodeError:
        return


@pytest.mark.parametrize(
    ("attribute", "value", "error"),
    [
        (POSITION, 1 << 31, ValueError),
        (POSITION, 0.5, ValueError),
        (POSITION, math.nan, ValueError),
        (VELOCITY, math.inf, ValueError),
        (POSITION, "1", TypeError),
        (POSITION, [1], TypeError),
        (IDNS, "S-0-0047", TypeError),
        (IDNS, 47, TypeError),
        (IDNS, ["47"], ValueError),
        (TEXT, 5, TypeError),
        (TEXT, "漢", ValueError),
        (Attribute(2, display=Display.UNSIGNED), -1, ValueError),
        (Attribute(4, display=Display.FLOAT), 1e300, ValueError),
        (Attribute(2, display=Display.TEXT), "abc", ValueError),
    ],
)
def test_a_value_that_does_not_fit_is_refused(
    attribute: Attribute, value: object, error: type[Exception]
) -> None:
    with pytest.raises(error):
        encode_value(attribute, value)  # type: ignore[arg-type]


def test_the_size_of_a_value_is_that_of_its_attribute() -> None:
    for data in ("00", "0000000000"):
        with pytest.raises(DecodeError, match="attribute states 4 bytes"):
            decode_value(POSITION, bytes.fromhex(data))
    with pytest.raises(DecodeError, match="multiple of 2"):
        decode_value(IDNS, bytes.fromhex("0300030001020304")[:7])
    with pytest.raises(DecodeError, match="after its end"):
        decode_value(TEXT, bytes.fromhex("01000100616263"))


def test_every_error_code_has_a_meaning() -> None:
    assert all(meaning.text for meaning in SPECIAL.values())
    assert error_meaning(0x1001).text == "the drive has no such IDN"
    assert error_meaning(0x2005).text == "the name is write-protected at this time"
    assert error_meaning(0x6001).text == "the maximum does not exist"
    assert error_meaning(0x8001).text == "the default value does not exist"
    assert error_meaning(0x800B).text == "general error"
    assert error_meaning(0x800C).text == "the request names no element"
    assert error_meaning(0xABCD).text == "code of the vendor"

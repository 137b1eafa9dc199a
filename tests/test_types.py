"""Data types: golden bytes, ranges, names and indices."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary import types
from catenary.errors import DecodeError
from catenary.types import (
    BIT3,
    BOOL,
    DINT,
    INT,
    INT24,
    LINT,
    LREAL,
    OCTET_STRING,
    REAL,
    UDINT,
    UINT,
    UNICODE_STRING,
    VISIBLE_STRING,
    Integer,
    by_index,
    by_name,
)

INTEGERS = [entry for entry in types.ALL if isinstance(entry, Integer)]


# ETG.1000.6 §5.6.7.3: index, name
@pytest.mark.parametrize(
    ("index", "name", "bit_length"),
    [
        (0x0001, "BOOL", 1),
        (0x0004, "DINT", 32),
        (0x0006, "UINT", 16),
        (0x0008, "REAL", 32),
        (0x0009, "VISIBLE_STRING", 0),
        (0x0010, "INT24", 24),
        (0x0011, "LREAL", 64),
        (0x0014, "INT56", 56),
        (0x0015, "LINT", 64),
        (0x0018, "UINT40", 40),
        (0x001B, "ULINT", 64),
        (0x001F, "WORD", 16),
        (0x0032, "BIT3", 3),
    ],
)
def test_indices(index, name, bit_length):
    entry = by_index(index)
    assert (entry.name, entry.bit_length) == (name, bit_length)
    assert by_name(name.lower()) is entry


def test_canopen_names():
    assert by_name("UNSIGNED16") is UINT
    assert by_name(" integer32 ") is DINT
    assert by_name("REAL64") is LREAL


def test_indices_and_names_are_unique():
    names = [name for entry in types.ALL for name in (entry.name, *entry.aliases)]
    assert len(set(names)) == len(names)
    assert len({entry.index for entry in types.ALL}) == len(types.ALL)


def test_unknown_names_and_indices_are_refused():
    with pytest.raises(ValueError, match=r"'FOO'.*known types: BOOL, SINT"):
        by_name("FOO")
    with pytest.raises(ValueError, match="0x0023"):
        by_index(0x0023)


def test_golden_bytes():
    assert UINT.encode(0x1234) == b"\x34\x12"
    assert INT.encode(-2) == b"\xfe\xff"
    assert INT24.encode(-1) == b"\xff\xff\xff"
    assert REAL.encode(1.0) == b"\x00\x00\x80\x3f"
    assert BOOL.encode(True) == b"\x01"
    assert VISIBLE_STRING.decode(b"EK1914\x00\x00") == "EK1914"
    assert UNICODE_STRING.encode("µ") == b"\xb5\x00"


def test_text_is_not_a_boolean():
    with pytest.raises(TypeError, match="BOOL: 'false' is text; use True or False"):
        BOOL.encode("false")


@pytest.mark.parametrize("entry", INTEGERS, ids=str)
@settings(max_examples=20)
@given(data=st.data())
def test_integers_round_trip_and_values_out_of_range_are_refused(entry, data):
    value = data.draw(st.integers(entry.minimum, entry.maximum))
    encoded = entry.encode(value)
    assert len(encoded) == entry.size
    assert entry.decode(encoded) == value
    assert entry.parse(str(value)) == entry.parse(hex(value)) == value
    for beyond in (entry.minimum - 1, entry.maximum + 1):
        with pytest.raises(ValueError, match=f"{beyond} is not in {entry.minimum} to"):
            entry.encode(beyond)


@given(st.floats(width=32))
def test_reals_round_trip(value):
    assert struct.pack("<d", REAL.decode(REAL.encode(value))) == struct.pack("<d", value)


@given(st.floats())
def test_long_reals_round_trip(value):
    assert struct.pack("<d", LREAL.decode(LREAL.encode(value))) == struct.pack("<d", value)


@given(st.text(st.characters(codec="latin-1", exclude_characters="\x00")))
def test_visible_strings_round_trip(text):
    assert VISIBLE_STRING.decode(VISIBLE_STRING.encode(text)) == text


@given(st.text(st.characters(codec="utf-8", exclude_characters="\x00")))
def test_unicode_strings_round_trip(text):
    assert UNICODE_STRING.decode(UNICODE_STRING.encode(text)) == text


@pytest.mark.parametrize("entry", types.ALL, ids=str)
@settings(max_examples=30)
@given(data=st.binary(max_size=20))
def test_any_bytes_give_a_value_or_decode_error(entry, data):
    try:
        value = entry.decode(data)
    except DecodeError:
        return
    again = entry.encode(value)
    assert entry.size in (0, len(again))
    assert entry.encode(entry.decode(again)) == again


@pytest.mark.parametrize("entry", [each for each in types.ALL if each.size], ids=str)
def test_another_length_is_refused(entry):
    for size in (entry.size - 1, entry.size + 1):
        with pytest.raises(DecodeError, match=f"{entry.name}: needs {entry.size} bytes"):
            entry.decode(bytes(size))


def test_values_of_other_types_are_refused():
    with pytest.raises(TypeError):
        UINT.encode(1.5)
    with pytest.raises(TypeError, match="REAL"):
        REAL.encode("1")
    with pytest.raises(ValueError, match="exceeds"):
        REAL.encode(1e39)
    with pytest.raises(ValueError, match="NUL"):
        VISIBLE_STRING.encode("a\x00b")
    with pytest.raises(ValueError, match="cannot be encoded"):
        VISIBLE_STRING.encode("\u20ac")


def test_undefined_bits_and_characters_are_refused():
    with pytest.raises(DecodeError, match="BIT3: 8 is not in 0 to 7"):
        BIT3.decode(b"\x08")
    with pytest.raises(DecodeError, match="UNICODE_STRING"):
        UNICODE_STRING.decode(b"\x00\xd8")


@pytest.mark.parametrize(
    ("entry", "text", "value"),
    [
        (UDINT, "0x10", 16),
        (LINT, "-5", -5),
        (BOOL, "True", True),
        (BOOL, "0", False),
        (LREAL, "1e-3", 0.001),
        (VISIBLE_STRING, "abc", "abc"),
        (OCTET_STRING, "0x0a0b", b"\x0a\x0b"),
    ],
)
def test_values_are_parsed_from_text(entry, text, value):
    assert entry.parse(text) == value


@pytest.mark.parametrize(
    ("entry", "text"),
    [
        *((UINT, "65536"), (UINT, "1.5"), (BOOL, "yes"), (REAL, "1e39"), (REAL, "nan")),
        *((REAL, "x"), (OCTET_STRING, "0xabc"), (VISIBLE_STRING, "\u20ac"), (types.GUID, "00")),
    ],
)
def test_invalid_text_is_refused(entry, text):
    with pytest.raises(ValueError, match=entry.name):
        entry.parse(text)


def test_infinity_is_a_value_of_the_type():
    assert math.isinf(REAL.decode(REAL.encode(math.inf)))


def test_an_array_is_a_tuple() -> None:
    kind = types.Array(types.UINT, 3)
    assert kind.encode((1, 2, 0xFFFF)) == b"\x01\x00\x02\x00\xff\xff"
    assert kind.decode(b"\x01\x00\x02\x00\xff\xff") == (1, 2, 0xFFFF)
    assert str(kind) == "ARRAY [1..3] OF UINT"
    with pytest.raises(DecodeError, match="needs 6 bytes, received 5"):
        kind.decode(bytes(5))
    with pytest.raises(ValueError, match="needs 3 values, got 2"):
        kind.encode((1, 2))


def test_an_array_of_bits_is_packed() -> None:
    kind = types.Array(types.BIT2, 5)
    assert kind.encode((1, 2, 3, 0, 1)) == bytes([0b00_11_10_01, 0b01])
    assert kind.decode(bytes([0b00_11_10_01, 0b01])) == (1, 2, 3, 0, 1)


def test_a_record_is_a_dict() -> None:
    kind = types.Record(
        {
            "vendor": types.UDINT,
            "ready": types.BOOL,
            "gap": types.BIT7,
            "speed": types.REAL,
            "name": types.sized(types.VISIBLE_STRING, 4),
        }
    )
    value = {"vendor": 2, "ready": True, "gap": 0, "speed": 0.5, "name": "abc"}
    data = b"\x02\x00\x00\x00\x01\x00\x00\x00\x3fabc\x00"
    assert kind.encode(value) == data
    assert kind.decode(data) == value
    with pytest.raises(ValueError, match="got values for vendor"):
        kind.encode({"vendor": 2})


def test_a_type_without_a_size_is_refused_in_a_record() -> None:
    with pytest.raises(ValueError, match=r"sized\(VISIBLE_STRING, 32\)"):
        types.Record({"name": types.VISIBLE_STRING})
    with pytest.raises(ValueError, match="longer than 4 bytes"):
        types.sized(types.VISIBLE_STRING, 4).encode("abcde")
    with pytest.raises(ValueError, match="UDINT of 4 bytes"):
        types.sized(types.UDINT, 4)

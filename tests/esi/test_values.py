"""Values in ESI files."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.esi.values import chosen_text, file_name, parse_data, parse_flag, parse_number


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("26", 26),
        ("#x1A", 26),
        ("#X1a", 26),
        ("0x1A", 26),
        ("#x0x1A", 26),
        ("#0x1A", 26),
        ("x1A", 26),
        ("  26\n", 26),
        ("# x 1A", 26),
        ("-26", -26),
        ("+26", 26),
        ("-#x1A", -26),
        ("0026", 26),
        ("#x", None),
        ("", None),
        ("abc-x", None),
        ("1e99", None),
        ("9" * 41, None),
        ("9" * 100_000, None),
        ("٣", None),  # a digit, but not an ASCII one
    ],
)
def test_numbers(text: str, value: int | None) -> None:
    if value is None:
        with pytest.raises(ValueError, match="is not a number"):
            parse_number(text)
    else:
        assert parse_number(text).value == value


@pytest.mark.parametrize("text", ["1A", "26.0", "26."])
def test_unusual_numbers_have_a_remark(text: str) -> None:
    found = parse_number(text)
    assert found.value == 26
    assert text in found.remark


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0", False),
        ("false", False),
        ("", False),
        (" FALSE ", False),
        ("1", True),
        ("true", True),
        ("True", True),
        ("#x1", True),
        ("2", True),
    ],
)
def test_booleans(text: str, value: bool) -> None:
    assert parse_flag(text) is value


def test_other_texts_are_not_booleans() -> None:
    with pytest.raises(ValueError, match="'maybe'"):
        parse_flag("maybe")


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("0102", b"\x01\x02"),
        (" 01 02\n0A ", b"\x01\x02\x0a"),
        ("#x0102", b"\x01\x02"),
        ("0x01", b"\x01"),
        ("", b""),
    ],
)
def test_data(text: str, data: bytes) -> None:
    assert parse_data(text) == (data, "")


def test_data_with_an_odd_number_of_digits_have_a_remark() -> None:
    data, remark = parse_data("1")
    assert data == b"\x01"
    assert "odd number of digits" in remark
    with pytest.raises(ValueError, match="'xyz' is not hexadecimal"):
        parse_data("xyz")


@pytest.mark.parametrize(
    ("texts", "expected"),
    [
        ([("1031", "de"), ("1033", "en")], "en"),
        ([("1031", "de"), (None, "x")], "x"),
        ([("2052", "zh"), ("1031", "de")], "de"),
        ([("1031", "de"), ("2057", "uk")], "uk"),
        ([("2052", "zh"), ("1041", "ja")], "zh"),
        ([("1033", ""), ("1031", "de")], "de"),
        ([("#x409", "en"), (None, "x")], "en"),
        ([("nonsense", "x"), ("1031", "de")], "x"),
        ([], ""),
    ],
)
def test_languages(texts: list[tuple[str | None, str]], expected: str) -> None:
    found = [({} if number is None else {"LcId": number}, text) for number, text in texts]
    assert chosen_text(found) == expected


def test_file_names() -> None:
    assert file_name(" Sub\\Other.xml\n") == "Sub/Other.xml"


@given(st.text())
def test_any_text_raises_nothing_but_value_errors(text: str) -> None:
    for parse in (parse_number, parse_flag, parse_data):
        with suppress(ValueError):
            parse(text)

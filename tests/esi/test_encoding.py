"""Encodings of ESI files."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.esi.document import make_document
from catenary.esi.encoding import choose_encoding, encoding_by_name
from catenary.esi.xml import find_elements

ALL = frozenset({""})


def text_of(data: bytes) -> str:
    document = make_document(data, "a.xml")
    return next(iter(find_elements(document, ALL))).element.text


def declared(encoding: str, text: str, codec: str) -> bytes:
    return f'<?xml version="1.0" encoding="{encoding}"?>\n<I>{text}</I>'.encode(codec)


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (declared("UTF-8", "µ 中", "utf-8"), "µ 中"),
        (declared("utf-8", "µ 中", "utf-8-sig"), "µ 中"),
        (declared("iso-8859-1", "grün", "latin-1"), "grün"),
        (declared("windows-1252", "10 €", "cp1252"), "10 €"),
        (declared("gb2312", "伺服驱动器", "gb2312"), "伺服驱动器"),
        (declared("GBK", "伺服驅動器", "gbk"), "伺服驅動器"),
        (declared("gb18030", "伺服𠀀", "gb18030"), "伺服𠀀"),
        (declared("shift_jis", "サーボ表", "shift_jis"), "サーボ表"),  # 表 contains 0x5C
        (declared("big5", "伺服", "big5"), "伺服"),
        (declared("utf-16", "伺服", "utf-16"), "伺服"),
        (declared("utf-16", "伺服", "utf-16-be"), "伺服"),
        ("<I>伺服 µ</I>".encode(), "伺服 µ"),
    ],
)
def test_declared_encodings(data: bytes, text: str) -> None:
    assert text_of(data) == text
    assert choose_encoding(data).warnings == ()


@pytest.mark.parametrize(
    ("data", "text", "name"),
    [
        (declared("utf-8", "für µ", "latin-1"), "für µ", "cp1252"),
        (declared("utf-8", "伺服驱动器", "gb2312"), "伺服驱动器", "gb18030"),
        (declared("utf-8", "サーボ", "shift_jis"), "サーボ", "cp932"),
        (declared("utf-16", "grün", "utf-8"), "grün", "utf-8"),
        (declared("gb2312", "grün 10 µm °C – ä", "utf-8"), "grün 10 µm °C – ä", "utf-8"),
        (declared("us-ascii", "grün", "latin-1"), "grün", "cp1252"),
        (declared("x-nonsense", "grün", "utf-8"), "grün", "utf-8"),
        (declared("hex", "a", "utf-8"), "a", "utf-8"),
        (declared("utf-7", "a+AGE-", "utf-8"), "a+AGE-", "utf-8"),
        ("<I>伺服驱动器</I>".encode("gb2312"), "伺服驱动器", "gb18030"),
    ],
)
def test_missing_and_wrong_declarations(data: bytes, text: str, name: str) -> None:
    choice = choose_encoding(data)
    assert len(choice.warnings) == (0 if b"us-ascii" in data else 1)
    assert (text_of(data), choice.encoding.name) == (text, name)


@pytest.mark.parametrize(("name", "codec"), [("utf-8", "utf-8"), ("gb2312", "gb2312")])
def test_faulty_characters_are_replaced(name: str, codec: str) -> None:
    data = declared(name, "伺服驱动器", codec).replace("驱".encode(codec), b"\xff")
    document = make_document(data, "a.xml")
    assert document.encoding.name in (name, "gb18030")
    assert "\ufffd" in text_of(data)
    (warning,) = document.warnings
    assert warning.source.line == 2
    assert "replaced" in warning.message


def test_half_a_character_in_utf_16() -> None:
    data = declared("utf-16", "a中b", "utf-16").replace("中".encode("utf-16-le"), b"\x00\xd8")
    assert text_of(data) == "a\ufffdb"
    assert text_of(data + b"x") == "a\ufffdb"


def test_character_references_in_bytewise_encodings() -> None:
    assert text_of(declared("gb2312", "伺&#x4E2D;服", "gb2312")) == "伺中服"


def test_utf_32_is_refused() -> None:
    with pytest.raises(ValueError, match="UTF-32"):
        choose_encoding("<I/>".encode("utf-32"))


@pytest.mark.parametrize("name", ["", "hex", "utf-7", "rot13", "cp037", "a\0b", "ä", "utf-32"])
def test_names_that_are_not_supported(name: str) -> None:
    assert encoding_by_name(name) is None


@given(st.binary(max_size=300), st.sampled_from(["utf-8", "gb2312", "utf-16", "shift_jis", "x"]))
def test_any_bytes_have_an_encoding(data: bytes, name: str) -> None:
    for attempt in (data, b'<?xml version="1.0" encoding="' + name.encode() + b'"?>' + data):
        if not attempt.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):
            choose_encoding(attempt)


def test_long_texts_take_linear_time() -> None:
    text = "a" * 2_000_000 + "&#x4E2D;"
    assert len(text_of(declared("gb2312", text, "gb2312"))) == 2_000_001

"""Checks of EEPROM images before a write."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.wire.sii import Category, CategoryType, Header, Sii
from catenary.wire.sii_check import objections

GOOD = Sii(
    Header(vendor=2, product=3, revision=4),
    (Category(CategoryType.STRINGS, b"\x01\x02ab"),),
).encode(2048)


def spoiled(at: int, value: bytes, image: bytes = GOOD) -> bytes:
    return image[:at] + value + image[at + len(value) :]


def test_a_good_image_has_no_objections() -> None:
    assert objections(GOOD) == ()


@pytest.mark.parametrize(
    ("image", "text"),
    [
        (b"", "the header alone needs"),
        (GOOD[:100], "100 bytes: the header alone needs 128"),
        (GOOD[:1001], "1001 bytes: the length must be even"),
        (bytes(0x20002), "an EEPROM has at most"),
        (spoiled(14, b"\x00"), "the checksum in word 7 is 0x0000"),
    ],
)
def test_objections_that_cannot_be_overridden(image: bytes, text: str) -> None:
    first = objections(image)[0]
    assert text in first.text
    assert not first.insist


@pytest.mark.parametrize(
    ("image", "text"),
    [
        (GOOD + b"\xff\xff", "2050 bytes, but its header specifies an EEPROM of 2048"),
        (spoiled(130, b"\xff\x7f"), "category 10 at byte 128 specifies 65534 bytes"),
        (GOOD[:136], "the categories have no end mark"),
        (spoiled(128, bytes(1920)), "the categories have no end mark"),
    ],
)
def test_objections_that_can_be_overridden(image: bytes, text: str) -> None:
    [only] = objections(image)
    assert text in only.text
    assert only.insist


def test_the_debugging_checksum_is_accepted() -> None:
    assert objections(spoiled(14, b"\xa4\x88")) == ()


@given(st.binary(max_size=4096))
def test_any_bytes_are_checked(image: bytes) -> None:
    assert all(each.text and each.hint for each in objections(image))

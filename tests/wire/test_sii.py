"""SII images: header, checksum, categories, hostile images. Real images: test_captures.py."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.errors import DecodeError
from catenary.wire import sii
from catenary.wire.sii import (
    Category,
    CategoryType,
    Header,
    MailboxArea,
    MailboxProtocol,
    Sii,
    checksum_of,
    decode_category_header,
    decode_header,
    decode_sii,
)
from catenary.wire.sii_categories import General, encode_strings
from tests.fuzz.fuzz_wire import PDO, STRINGS
from tests.fuzz.fuzz_wire import SII as IMAGE
from tests.wire.strategies import u16, u32

areas = st.builds(MailboxArea, u16, u16)
headers = st.builds(
    Header,
    *(u32, u32, u32, u32, u16, u16, u16, u16, u16, st.none(), areas, areas, areas, areas),
    *(u16.map(MailboxProtocol), st.integers(1, 0x10000), u16),
    st.binary(min_size=78, max_size=78),
)
words = st.binary(max_size=40).map(lambda data: data + b"\x00" * (len(data) % 2))
vendor_categories = st.builds(Category, st.integers(0x8000, 0xFFFE), words)


# The first 8 words of ethercrab's dumps/ek1100-eeprom-dump.bin, el2004-eeprom-dump.bin, and of
# MetalMusings EaserCAT 2000
@pytest.mark.parametrize(
    "words",
    [
        "000d0000000000000000000000004600",
        "0401000000000f00000000000000d800",
        "80060344640000000000000000001400",
    ],
)
def test_checksums_of_real_headers(words):
    data = bytes.fromhex(words)
    assert checksum_of(data) == data[14]


@given(headers)
def test_a_header_round_trips(header):
    decoded = decode_header(header.encode())
    assert decoded == dataclasses.replace(header, checksum=checksum_of(header.encode()))


@given(headers, st.lists(vendor_categories, max_size=5), st.sampled_from((b"", b"\xff\xff")))
def test_an_image_round_trips(header, categories, trailing):
    image = Sii(header, tuple(categories), trailing).encode()
    assert decode_sii(image).encode() == image


def test_decoded_categories():
    image = decode_sii(IMAGE)
    assert image.strings == ("Servo", "drive", "in")
    assert image.general is not None
    assert (image.string(image.general.name), image.string(image.general.order)) == (
        "Servo",
        "drive",
    )
    assert image.fmmus == (1, 2, 3, 0xFF)
    assert [each.address for each in image.sync_managers] == [0x1000, 0x1200, 0x1600, 0x1A00]
    assert [pdo.index for pdo in image.transmit_pdos] == [0x1600, 0x1601]
    assert image.receive_pdos == ()
    assert image.clock_modes[0].assign_activate == 0x0700
    assert image.trailing == b"\xff\xff"


def test_categories_of_one_kind_are_joined():
    # as in pollen_Orbita2d.bin: a TXPDO category for each PDO
    each = Category(CategoryType.TXPDO, PDO[:16])
    image = decode_sii(Sii(Header(1, 2, 3), (each, each)).encode())
    assert [pdo.index for pdo in image.transmit_pdos] == [0x1600, 0x1600]


def test_missing_categories_are_empty():
    image = decode_sii(Sii(Header(1, 2, 3)).encode())
    assert image.general is None
    assert image.strings == image.fmmus == image.sync_managers == ()
    assert image.string(0) == image.string(1) == ""


def test_an_image_is_padded_to_the_eeprom_size():
    image = Sii(Header(1, 2, 3)).encode(2048)
    assert len(image) == 2048
    assert set(image[128:]) == {0xFF}
    with pytest.raises(ValueError, match="exceed the EEPROM of 100"):
        Sii(Header(1, 2, 3)).encode(100)


def test_a_wrong_checksum_error_names_both_values():
    broken = b"\x01" + IMAGE[1:]
    with pytest.raises(DecodeError, match=r"checksum 0x.+, expected 0x"):
        decode_sii(broken)


def test_the_debugging_checksum_is_accepted_as_by_controllers():
    image = IMAGE[:14] + b"\xa4\x88" + IMAGE[16:]
    assert decode_sii(image).header.checksum == 0x88A4
    assert decode_sii(image).encode() == image


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (IMAGE[:127], "needs 128 bytes, received 127"),
        (
            IMAGE[:128] + b"\x0a\x00\xff\x7f",
            r"category 10 at byte 128 specifies 65534 bytes, but 0 are left",
        ),
        (IMAGE[:128] + b"\x0a\x00\x00", "category header: needs 4 bytes, 3 left"),
        (IMAGE[:128] + bytes(0x10000), "more than 512 categories"),
        (IMAGE[:128] + bytes(0x20000), "the maximum is 131072"),
        (IMAGE[:128] + bytes.fromhex("0a0001000505"), "string 1 of 5 at byte 1 exceeds"),
        (IMAGE[:128] + bytes.fromhex("1e0001000505"), "general category"),
        (IMAGE[:128] + bytes.fromhex("320004000016ff0000000000"), r"PDO 0x1600: 255 entries"),
    ],
)
def test_hostile_images_are_refused_with_the_reason(image, reason):
    with pytest.raises(DecodeError, match=reason):
        decode_sii(image)


def test_category_headers_give_the_length():
    assert decode_category_header(IMAGE[128:132]) == (10, len(STRINGS))
    assert decode_category_header(b"\xff\xff\xff\xff") == (sii.END_OF_CATEGORIES, 0)
    assert decode_category_header(b"\xff\xff") == (sii.END_OF_CATEGORIES, 0)


@pytest.mark.parametrize(
    "value",
    [
        Header(1 << 32, 0, 0),
        Header(0, 0, 0, size_kbit=0),
        Header(0, 0, 0, reserved=b""),
        Category(0, b"odd"),
        Category(0x10000, b""),
        Sii(Header(0, 0, 0), (Category(1, bytes(0x20000)),)),
        General(reserved=b""),
    ],
)
def test_values_that_do_not_fit_are_refused(value):
    with pytest.raises(ValueError, match="SII"):
        value.encode()


def test_strings_that_do_not_fit_are_refused():
    for strings in (("x",) * 256, ("x" * 256,), ("\u20ac",)):
        with pytest.raises(ValueError, match="SII string"):
            encode_strings(strings)

"""Whether bytes may become the image of an EEPROM, ETG.2010: what a device would choke on."""

from __future__ import annotations

from typing import NamedTuple

from catenary.errors import DecodeError
from catenary.wire.sii import (
    CHECKSUM_DISABLED,
    CHECKSUM_WORD,
    HEADER_SIZE,
    MAXIMUM_SIZE,
    checksum_of,
    decode_sii,
)

BYTES_PER_KBIT = 128
_SIZE_WORD = 0x003E
_END = b"\xff\xff"


class Objection(NamedTuple):
    """Why an image should not be written, and what to do about it."""

    text: str
    hint: str
    insist: bool = False  # somebody who knows better may write it all the same


def objections(image: bytes) -> tuple[Objection, ...]:
    """What is wrong with an image by itself. None: it may be written."""
    if len(image) < HEADER_SIZE or len(image) > MAXIMUM_SIZE or len(image) % 2:
        return (_length(image),)
    found = [each for each in (_checksum(image), _size(image), _categories(image)) if each]
    return tuple(found)


def _length(image: bytes) -> Objection:
    if len(image) % 2:
        what = f"{len(image)} bytes are no whole words"
    elif len(image) < HEADER_SIZE:
        what = f"{len(image)} bytes are less than a header, which has {HEADER_SIZE}"
    else:
        what = f"{len(image)} bytes are more than any EEPROM has ({MAXIMUM_SIZE})"
    return Objection(what, "an image is binary, not Intel hex and not ESI (XML): make one of those")


def _checksum(image: bytes) -> Objection | None:
    checksum = int.from_bytes(image[2 * CHECKSUM_WORD : 2 * CHECKSUM_WORD + 2], "little")
    right = checksum_of(image)
    if checksum & 0xFF == right or checksum == CHECKSUM_DISABLED:
        return None
    return Objection(
        f"the checksum in word 7 is 0x{checksum:04X}, the first seven words make 0x{right:04X}",
        "the device would not load its configuration; after a change by hand put "
        f"0x{right:02X} into byte 14",
    )


def _size(image: bytes) -> Objection | None:
    said = (int.from_bytes(image[2 * _SIZE_WORD : 2 * _SIZE_WORD + 2], "little") + 1) * (
        BYTES_PER_KBIT
    )
    if len(image) <= said:
        return None
    return Objection(
        f"the image has {len(image)} bytes, but says of itself that the EEPROM has {said}",
        "word 0x3E holds the size of the EEPROM in kbit, less one",
        insist=True,
    )


def _categories(image: bytes) -> Objection | None:
    start = 2 * CHECKSUM_WORD
    trusted = image[:start] + CHECKSUM_DISABLED.to_bytes(2, "little") + image[start + 2 :]
    try:
        sii = decode_sii(trusted)
    except DecodeError as error:
        return Objection(
            error.message,
            "the file is cut short or damaged; compare it with its maker's",
            insist=True,
        )
    if sii.trailing[:2] != _END:
        return Objection(
            "the categories have no end mark (0xFFFF)",
            "append ff ff: without it a MainDevice reads on into what was there before",
            insist=True,
        )
    return None

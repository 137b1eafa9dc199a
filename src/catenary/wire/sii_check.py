"""Checks of an EEPROM image before a write, ETG.2010."""

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
    """A reason not to write an image, and a hint."""

    text: str
    hint: str
    insist: bool = False  # True if the user may override the objection


def objections(image: bytes) -> tuple[Objection, ...]:
    """Return the objections to writing an image; empty if it is valid."""
    if len(image) < HEADER_SIZE or len(image) > MAXIMUM_SIZE or len(image) % 2:
        return (_length(image),)
    found = [each for each in (_checksum(image), _size(image), _categories(image)) if each]
    return tuple(found)


def _length(image: bytes) -> Objection:
    if len(image) % 2:
        what = f"{len(image)} bytes: the length must be even"
    elif len(image) < HEADER_SIZE:
        what = f"{len(image)} bytes: the header alone needs {HEADER_SIZE}"
    else:
        what = f"{len(image)} bytes: an EEPROM has at most {MAXIMUM_SIZE}"
    return Objection(what, "the image must be binary: convert Intel hex or ESI (XML) first")


def _checksum(image: bytes) -> Objection | None:
    checksum = int.from_bytes(image[2 * CHECKSUM_WORD : 2 * CHECKSUM_WORD + 2], "little")
    right = checksum_of(image)
    if checksum & 0xFF == right or checksum == CHECKSUM_DISABLED:
        return None
    return Objection(
        f"the checksum in word 7 is 0x{checksum:04X}, but the first seven words give 0x{right:04X}",
        "the device would not load its configuration; if you edited the image, write "
        f"0x{right:02X} to byte 14",
    )


def _size(image: bytes) -> Objection | None:
    specified = (int.from_bytes(image[2 * _SIZE_WORD : 2 * _SIZE_WORD + 2], "little") + 1) * (
        BYTES_PER_KBIT
    )
    if len(image) <= specified:
        return None
    return Objection(
        f"the image has {len(image)} bytes, but its header specifies an EEPROM of {specified} "
        "bytes",
        "word 0x3E must contain the size of the EEPROM in kbit minus one",
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
            "the file is truncated or damaged; compare it with the vendor's file",
            insist=True,
        )
    if sii.trailing[:2] != _END:
        return Objection(
            "the categories have no end mark (0xFFFF)",
            "append ff ff: without it, a MainDevice also reads the old content after the image",
            insist=True,
        )
    return None

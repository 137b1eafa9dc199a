"""Values in ESI files: numbers, booleans, hexadecimal data, texts, file names and languages.

ETG.2000 allows `#x1A` and decimal numbers. Vendors also write `0x1A`, `#x0x1A`, `x1A`, blanks,
and hexadecimal numbers without a prefix. The functions return the value and a remark; the remark is
empty if the notation is a common one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

NUMBER = re.compile(r"([+-]?)((?:#?0?x)+|#)?([0-9a-f]{1,40})")
DECIMAL = re.compile(r"([+-]?[0-9]{1,40})\.0*")
EXPONENT = re.compile(r"[0-9]+e[0-9]+")  # neither decimal nor certainly hexadecimal
BLANK = re.compile(r"\s+")
HEX_PREFIX = re.compile(r"(?:#?0?x)+", re.IGNORECASE)
DIGITS_MAX = 40
ENGLISH, GERMAN = 1033, 1031
PRIMARY_LANGUAGE, ENGLISH_LANGUAGE = 0x3FF, 0x09  # part of an LcId, in all countries
TRUTH = {"0": False, "false": False, "no": False, "1": True, "true": True, "yes": True, "": False}
SHOWN = 40  # characters of a faulty value in a message


class Parsed(NamedTuple):
    """Number with a remark about its notation."""

    value: int
    remark: str = ""


def parse_number(text: str) -> Parsed:
    """Return a number.

    Raises:
        ValueError: The text is not a number, or has more than 40 digits.
    """
    if text.isascii() and text.isdigit() and len(text) <= DIGITS_MAX:  # the usual case
        return Parsed(int(text))
    compact = BLANK.sub("", text).lower()
    found = NUMBER.fullmatch(compact)
    if found is None or EXPONENT.fullmatch(compact):
        return _from_decimal(text, compact)
    sign, prefix, digits = found.groups()
    if prefix:
        return Parsed(_signed(sign, int(digits, 16)))
    if digits.isdecimal():
        return Parsed(_signed(sign, int(digits)))
    remark = f"{shown(text)} has no prefix; read as the hexadecimal number #x{digits}"
    return Parsed(_signed(sign, int(digits, 16)), remark)


def _from_decimal(text: str, compact: str) -> Parsed:
    found = DECIMAL.fullmatch(compact)
    if found is None:
        raise ValueError(f"{shown(text)} is not a number")
    return Parsed(int(found[1]), f"{shown(text)} is not an integer; read as {found[1]}")


def _signed(sign: str, value: int) -> int:
    return -value if sign == "-" else value


def parse_flag(text: str) -> bool:
    """Return a boolean. Numbers other than 0 are true.

    Raises:
        ValueError: The text is neither a boolean nor a number.
    """
    found = TRUTH.get(text.strip().lower())
    return parse_number(text).value != 0 if found is None else found


def parse_data(text: str) -> tuple[bytes, str]:
    """Return hexadecimal data and a remark. Blanks and a prefix are ignored.

    Raises:
        ValueError: The text contains other characters.
    """
    digits = BLANK.sub("", text)
    prefix = HEX_PREFIX.match(digits)
    if prefix is not None:
        digits = digits[prefix.end() :]
    remark = ""
    if len(digits) % 2:
        digits = "0" + digits
        remark = f"the data {shown(text)} have an odd number of digits; read as {shown(digits)}"
    try:
        return bytes.fromhex(digits), remark
    except ValueError:
        raise ValueError(f"{shown(text)} is not hexadecimal data") from None


def plain_text(text: str) -> str:
    """Return a text in one line, without blanks at its ends."""
    return " ".join(text.split())


def file_name(text: str) -> str:
    """Return a file name with slashes; vendors write backslashes."""
    return plain_text(text).replace("\\", "/")


def chosen_text(texts: Iterable[tuple[Mapping[str, str], str]]) -> str:
    """Return the text in the preferred language: English, unspecified, German, the first.

    The schema gives English as the default (EtherCATBase.xsd, NameType).

    Args:
        texts: The attributes and the text of each element.
    """
    found = [(_rank(attributes), plain_text(text)) for attributes, text in texts]
    best = min((item for item in found if item[1]), key=lambda item: item[0], default=(0, ""))
    return best[1]


def _rank(attributes: Mapping[str, str]) -> int:
    if "LcId" not in attributes:
        return 2
    try:
        language = parse_number(attributes["LcId"]).value
    except ValueError:
        return 2
    if language == ENGLISH:
        return 0
    if language & PRIMARY_LANGUAGE == ENGLISH_LANGUAGE:
        return 1
    return 3 if language == GERMAN else 4


def shown(text: str) -> str:
    """Return a value as it appears in a message: quoted, and shortened."""
    plain = plain_text(text[: 4 * SHOWN])
    return repr(plain if len(plain) <= SHOWN else plain[:SHOWN] + "...")

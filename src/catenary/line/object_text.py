"""Fields of a line in objects.tsv: text from values and back. Parsers raise ValueError."""

from __future__ import annotations

import re

from catenary.types import by_index, by_name
from catenary.wire.sdo_information import Access, ObjectCode

STATES = "PSO"  # PRE-OP, SAFE-OP, OP
_ESCAPE = re.compile(r"\\(?:x([0-9a-f]{2})|u([0-9a-f]{4})|U([0-9a-f]{8})|(.?))")
_PLAIN = {"\\": "\\", "t": "\t", "n": "\n", "r": "\r"}
_ABORT = re.compile(r"0x[0-9A-F]{8}")
_ACCESS = re.compile(
    r"r([P-][S-][O-]) w([P-][S-][O-]) ([R-])([T-])([B-])([C-])(?: 0x([0-9A-F]{4}))?"
)
_FLAGS = (Access.RXPDO_MAPPABLE, Access.TXPDO_MAPPABLE, Access.BACKUP, Access.SETTING)
_UNDEFINED = 0xFC00  # bits that the standard reserves


def escaped(text: str) -> str:
    """Return a text without tabs, line ends and other unprintable characters."""
    return "".join(
        "\\\\"
        if letter == "\\"
        else letter
        if letter.isprintable()
        else letter.encode("unicode_escape").decode("ascii")
        for letter in text
    )


def unescaped(text: str) -> str:
    """Return the text that `escaped` had."""

    def plain(found: re.Match[str]) -> str:
        number = found[1] or found[2] or found[3]
        if number:
            code = int(number, 16)
            if code > 0x10FFFF:
                raise ValueError(f"not a character: {found[0]}")
            return chr(code)
        if found[4] not in _PLAIN:
            raise ValueError(f"unknown escape {found[0]!r}; a backslash is \\\\")
        return _PLAIN[found[4]]

    return _ESCAPE.sub(plain, text)


def type_text(data_type: int) -> str:
    """Return the name of a base type, or the number of another type, such as "0x0023"."""
    try:
        name = by_index(data_type).name
    except ValueError:
        return f"0x{data_type:04X}"
    return name if by_name(name).index == data_type else f"0x{data_type:04X}"


def type_of(text: str) -> int:
    """Return the number of a data type."""
    if text.startswith("0x"):
        return number_of("type", text, 0xFFFF)
    return by_name(text).index


def code_text(code: int) -> str:
    """Return the name of an object code, such as "RECORD", or its number."""
    try:
        return ObjectCode(code).name
    except ValueError:
        return f"0x{code:02X}"


def code_of(text: str) -> int:
    """Return an object code."""
    if text.startswith("0x"):
        return number_of("object code", text, 0xFF)
    try:
        return int(ObjectCode[text])
    except KeyError:
        known = ", ".join(each.name for each in ObjectCode)
        raise ValueError(f"unknown object code {text!r}; known: {known}") from None


def access_text(access: Access) -> str:
    """Return access rights as text: "rPSO wP-- RT--".

    The states of reading, the states of writing, mappable to RxPDO (R) and TxPDO (T), backup (B)
    and setting (C). Bits that the standard reserves follow as a number.
    """
    read, write = (_states(access >> shift) for shift in (0, 3))
    flags = "".join(c if access & bit else "-" for c, bit in zip("RTBC", _FLAGS, strict=True))
    rest = f" 0x{access & _UNDEFINED:04X}" if access & _UNDEFINED else ""
    return f"r{read} w{write} {flags}{rest}"


def access_of(text: str) -> Access:
    """Return the access rights of a text."""
    found = _ACCESS.fullmatch(text)
    if found is None:
        raise ValueError(f"access {text!r} is not valid; example: rPSO wP-- RT--")
    word = int(found[7] or "0", 16)
    if word & ~_UNDEFINED:
        raise ValueError(f"access {text!r}: 0x{word:04X} has bits with a letter of their own")
    for shift, group in ((0, found[1]), (3, found[2])):
        word |= sum(1 << shift + bit for bit in range(3) if group[bit] != "-")
    for number, bit in enumerate(_FLAGS, start=3):
        word |= bit if found[number] != "-" else 0
    return Access(word)


def _states(bits: int) -> str:
    return "".join(letter if bits >> bit & 1 else "-" for bit, letter in enumerate(STATES))


def abort_of(text: str) -> int | None:
    """Return the abort code in the field of the reason; None if it has another text."""
    return int(text, 16) if _ABORT.fullmatch(text) else None


def number_of(what: str, text: str, highest: int) -> int:
    """Return a decimal or hexadecimal number.

    Args:
        what: Name of the field, for errors.
        text: The text.
        highest: Largest valid value.
    """
    if not re.fullmatch(r"0x[0-9A-Fa-f]{1,8}|[0-9]{1,10}", text):
        raise ValueError(f"{what} {text!r} is not a number")
    value = int(text, 16 if text.startswith("0x") else 10)
    if value > highest:
        raise ValueError(f"{what} {text} is out of range (0 to {highest})")
    return value

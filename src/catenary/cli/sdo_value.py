"""Values of objects on the command line: from text or stdin, and as text."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from catenary.cli.failure import UsageError
from catenary.cli.text import escaped

if TYPE_CHECKING:
    from catenary.model.device import ObjectInformation
    from catenary.types import DataType, Value

NUMBER_SIZES = (1, 2, 4, 8)  # sizes of numbers [bytes]
STDIN_MAX = 1 << 24  # largest value from stdin [bytes]
Given = TypeVar("Given", str, bytes)


def data_type(name: str | None) -> DataType[Value] | None:
    """Return the data type of a name; None without a name. Raises UsageError if it is unknown."""
    from difflib import get_close_matches

    from catenary.types import ALL, by_name

    if name is None:
        return None
    try:
        return by_name(name)
    except ValueError as error:
        near = get_close_matches(name.upper(), [kind.name for kind in ALL], n=1, cutoff=0.5)
        guess = f"did you mean {near[0]}? " if near else ""
        hint = f"{guess}types: BOOL, SINT, INT, DINT, USINT, UINT, UDINT, REAL, STRING, BYTES, ..."
        raise UsageError(f"unknown data type {name!r}", hint=hint) from error


def parse_value(kind: DataType[Value], text: str) -> Value:
    """Return the value of a text. The text - is replaced by stdin."""
    from catenary.types import Octets

    if text == "-" and isinstance(kind, Octets):
        return bounded(sys.stdin.buffer.read(STDIN_MAX + 1))
    try:
        return kind.parse(
            bounded(sys.stdin.read(STDIN_MAX + 1)).rstrip("\n") if text == "-" else text
        )
    except ValueError as error:
        raise UsageError(str(error), hint="write numbers as decimal or 0x...") from error


def bounded(given: Given) -> Given:
    """Return the value from stdin. Raises UsageError if it is too large."""
    if len(given) > STDIN_MAX:
        raise UsageError(f"stdin has more than {STDIN_MAX} bytes", hint="check the file")
    return given


def write_bytes(path: str, data: bytes) -> None:
    """Write bytes to a file, or to stdout for "-"."""
    if path == "-":
        sys.stdout.buffer.write(data)
    else:
        Path(path).write_bytes(data)


def as_text(data: bytes, value: Value | None) -> str:
    """Return the value as text, with the control characters of a string escaped."""
    if value is None:
        return explain(data)
    return escaped(value) if isinstance(value, str) else str(value)


def documented_value(known: ObjectInformation, data: bytes) -> Value | None:
    """Return the value by the data type in the ESI of the device; None if it does not fit."""
    from catenary.errors import DecodeError
    from catenary.types import by_index

    try:
        return by_index(known.data_type).decode(data)
    except (ValueError, DecodeError):
        return None


def meaning(known: ObjectInformation | None, value: Value | None) -> str:
    """Return the unit and the name of a value in the ESI, such as " mV" or "  (CSP)"."""
    if known is None or value is None:
        return ""
    text = dict(known.enumeration).get(value) if isinstance(value, int) else None
    return f" {known.unit}" * bool(known.unit) + f"  ({text})" * bool(text)


def explain(data: bytes) -> str:
    """Return bytes of unknown type as hexadecimal digits, and as a likely number or text."""
    if len(data) in NUMBER_SIZES:
        number = int.from_bytes(data, "little")
        return f"{data.hex(' ')}  (0x{number:0{2 * len(data)}X}, {number})"
    text = data.rstrip(b"\x00")
    if text and all(0x20 <= byte < 0x7F for byte in text):
        return f"{data.hex(' ')}  ({text.decode()!r})"
    return data.hex(" ")

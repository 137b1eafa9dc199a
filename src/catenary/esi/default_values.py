"""Default values and limits in an ESI dictionary, as little-endian bytes of the object.

`DefaultData` contains the bytes as they are transferred. `DefaultValue` is a number, and
`DefaultString` a text; the data type of the entry determines their bytes.
"""

from __future__ import annotations

from catenary.esi.findings import Findings
from catenary.esi.values import HEX_PREFIX, parse_flag, parse_number, shown
from catenary.esi.xml import Element
from catenary.types import BOOL, UNICODE_STRING, DataType, Real, Value, by_name

INTEGER_BITS = 64


def read_value(
    element: Element | None, base: str, bit_length: int, findings: Findings
) -> bytes | None:
    """Return the bytes of a value; None if it is missing or does not fit into the entry.

    Args:
        element: The element, such as `DefaultData`; None if the file does not have it.
        base: The name of the base data type of the entry.
        bit_length: The length of the entry [bits].
        findings: The warnings of the reader.
    """
    if element is None or not element.text.strip():
        return None
    if element.tag.endswith("Data"):
        return findings.data(element)
    if element.tag == "DefaultString":
        return _text(element.text.strip(), base)
    try:
        return _number(element.text.strip(), base, bit_length)
    except ValueError as error:
        findings.warn(element, f"{element.tag}: {error}; ignored")
        return None


def _text(text: str, base: str) -> bytes:
    kind = _kind(base)
    if kind is UNICODE_STRING or base.upper().startswith(("UNICODE", "WSTRING")):
        return text.encode("utf-16-le", "replace")
    return text.encode("utf-8", "replace")


def _number(text: str, base: str, bit_length: int) -> bytes:
    """Return the bytes of a number. Raises ValueError if it is not one, or does not fit."""
    kind = _kind(base)
    bits = bit_length or (kind.bit_length if kind is not None else 0)
    if isinstance(kind, Real) and not HEX_PREFIX.match(text):
        return kind.encode(kind.parse(text.replace(",", ".")))
    value = int(parse_flag(text)) if kind is BOOL else parse_number(text).value
    if not 0 < bits <= INTEGER_BITS:
        raise ValueError(f"{shown(text)} is a number, but the entry has {bits} bits")
    if not -(1 << bits - 1) <= value < 1 << bits:
        raise ValueError(f"{shown(text)} does not fit into {bits} bits")
    size = (bits + 7) // 8
    return (value % (1 << bits) if value < 0 else value).to_bytes(size, "little")


def _kind(name: str) -> DataType[Value] | None:
    try:
        return by_name(name)
    except ValueError:
        return None

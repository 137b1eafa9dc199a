"""Values of objects and registers as text, for messages."""

from __future__ import annotations

from catenary.errors import DecodeError
from catenary.types import BITARR8, BITARR16, BITARR32, BYTE, DWORD, WORD, by_index

BYTES_SHOWN = 16
TEXT_SHOWN = 60  # characters
BIT_PATTERNS = {each.index for each in (BYTE, WORD, DWORD, BITARR8, BITARR16, BITARR32)}


def value_texts(data_type: int, old: bytes, new: bytes) -> tuple[str, str]:
    """Return two values of one entry as text.

    Args:
        data_type: Index of the data type; bytes of another type are hexadecimal.
        old: The earlier value.
        new: The present value.
    """
    texts = value_text(data_type, old), value_text(data_type, new)
    return texts if texts[0] != texts[1] else bytes_texts(old, new)


def value_text(data_type: int, data: bytes) -> str:
    """Return a value by its type, as hexadecimal bytes if it does not fit.

    Args:
        data_type: Index of the data type.
        data: The value.
    """
    try:
        value = by_index(data_type).decode(data)
    except (ValueError, DecodeError):
        return bytes_text(data)
    if isinstance(value, bytes):
        return bytes_text(value)
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= TEXT_SHOWN else f'"{value[:TEXT_SHOWN]}..."'
    return f"0x{value:0{2 * len(data)}X}" if data_type in BIT_PATTERNS else str(value)


def type_name(data_type: int) -> str:
    """Return the name of a base type; the number of another type."""
    try:
        return by_index(data_type).name
    except ValueError:
        return f"0x{data_type:04X}"


def bytes_text(data: bytes) -> str:
    """Return bytes as hexadecimal digits, the first ones if there are many."""
    if not data:
        return "empty"
    more = f" ... ({len(data)} bytes)" if len(data) > BYTES_SHOWN else ""
    return data[:BYTES_SHOWN].hex(" ") + more


def bytes_texts(old: bytes, new: bytes) -> tuple[str, str]:
    """Return two byte strings from their first difference on.

    Args:
        old: The earlier bytes.
        new: The present bytes.
    """
    if max(len(old), len(new)) <= BYTES_SHOWN:
        return bytes_text(old), bytes_text(new)
    pairs = enumerate(zip(old, new, strict=False))
    first = next((n for n, (a, b) in pairs if a != b), min(len(old), len(new)))
    return _from(old, first), _from(new, first)


def _from(data: bytes, first: int) -> str:
    shown = data[first : first + BYTES_SHOWN].hex(" ") or "end"
    return f"{shown} at byte {first} of {len(data)}"

"""Values of SERCOS parameters in displayed numbers, as their attribute defines them."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import TypeAlias

from catenary.errors import DecodeError
from catenary.wire.sercos import (
    Attribute,
    Display,
    encode_list,
    idn_number,
    idn_text,
    split_list,
)

Item: TypeAlias = int | float | str
Value: TypeAlias = int | float | str | list[Item]
_FLOATS = {4: "<f", 8: "<d"}


def decode_value(attribute: Attribute, data: bytes) -> Value:
    """Decode a value, minimum, maximum or default value.

    Args:
        attribute: Attribute of the IDN.
        data: Bytes of the element.

    Returns:
        An integer; a float if the attribute has decimals or is a float; a text; the notation of an
        IDN; or a list of these.

    Raises:
        DecodeError: The size differs from the attribute, or a list has invalid lengths.
    """
    if not attribute.is_list:
        _check_size(attribute, data)
        return _item(attribute, data)
    content, _maximum, rest = split_list(data)
    if rest:
        raise DecodeError(f"list: {len(rest)} bytes after its end")
    if attribute.display is Display.TEXT:
        return content.rstrip(b"\x00").decode("latin-1")
    if len(content) % attribute.size:
        raise DecodeError(f"list: {len(content)} bytes are not a multiple of {attribute.size}")
    step = attribute.size
    return [_item(attribute, content[at : at + step]) for at in range(0, len(content), step)]


def encode_value(attribute: Attribute, value: Value, maximum: int | None = None) -> bytes:
    """Return the encoded bytes of a value.

    Args:
        attribute: Attribute of the IDN.
        value: Value, as `decode_value` returns it.
        maximum: Maximum length of a list [bytes]; None: the length of the value.

    Raises:
        ValueError: The value does not fit.
        TypeError: The value has the wrong type.
    """
    if not attribute.is_list:
        if isinstance(value, list):
            raise TypeError(f"one value is needed, not a list of {len(value)}")
        return _encode_item(attribute, value)
    if attribute.display is Display.TEXT:
        return encode_list(_text(value), maximum)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise TypeError(f"a list is needed, not {value!r}")
    return encode_list(b"".join(_encode_item(attribute, each) for each in value), maximum)


def _check_size(attribute: Attribute, data: bytes) -> None:
    if len(data) != attribute.size:
        raise DecodeError(
            f"value of {len(data)} bytes, but its attribute states {attribute.size} bytes"
        )


def _item(attribute: Attribute, data: bytes) -> Item:
    display = attribute.display
    if display is Display.FLOAT and attribute.size in _FLOATS:
        return float(struct.unpack(_FLOATS[attribute.size], data)[0])
    if display is Display.TEXT:
        return data.rstrip(b"\x00").decode("latin-1")
    number = int.from_bytes(data, "little", signed=display is Display.SIGNED)
    if display is Display.IDN and attribute.size == 2:
        return idn_text(number)
    if _is_scaled(attribute):
        return number * (attribute.factor or 1) / float(10**attribute.decimals)
    return number


def _is_scaled(attribute: Attribute) -> bool:
    """Return True if the displayed number differs from the transmitted one."""
    numeric = attribute.display in (Display.UNSIGNED, Display.SIGNED)
    return numeric and (attribute.decimals > 0 or attribute.factor > 1)


def _encode_item(attribute: Attribute, value: Item) -> bytes:
    display = attribute.display
    if display is Display.TEXT:
        return _padded(attribute, _text(value))
    if display is Display.IDN and attribute.size == 2 and isinstance(value, (int, str)):
        return idn_number(value).to_bytes(2, "little")
    if isinstance(value, str):
        raise TypeError(f"a number is needed, not {value!r}")
    if display is Display.FLOAT and attribute.size in _FLOATS:
        return _packed(_FLOATS[attribute.size], value)
    number = _raw(attribute, value)
    try:
        return number.to_bytes(attribute.size, "little", signed=display is Display.SIGNED)
    except OverflowError:
        raise ValueError(
            f"{value} does not fit into {attribute.size} bytes, {display.name.lower()}"
        ) from None


def _raw(attribute: Attribute, value: float) -> int:
    """Return the transmitted integer of a displayed number."""
    if _is_scaled(attribute):
        try:
            scale: int = 10**attribute.decimals
            return round(value * scale / (attribute.factor or 1))
        except (OverflowError, ValueError):
            raise ValueError(f"{value} is not a finite number") from None
    if value != value or value in (float("inf"), float("-inf")) or int(value) != value:
        raise ValueError(f"{value} is not an integer, but the attribute has no decimals")
    return int(value)


def _packed(form: str, value: float) -> bytes:
    try:
        return struct.pack(form, value)
    except OverflowError:
        raise ValueError(f"{value} does not fit into {struct.calcsize(form)} bytes") from None


def _padded(attribute: Attribute, text: bytes) -> bytes:
    if len(text) > attribute.size:
        raise ValueError(f"text of {len(text)} bytes exceeds {attribute.size} bytes")
    return text.ljust(attribute.size, b"\x00")


def _text(value: object) -> bytes:
    if not isinstance(value, str):
        raise TypeError(f"a text is needed, not {value!r}")
    try:
        return value.encode("latin-1")
    except UnicodeEncodeError:
        raise ValueError(f"{value!r} has characters that do not fit into one byte") from None

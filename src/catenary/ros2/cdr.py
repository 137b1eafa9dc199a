"""Common Data Representation of messages: plain CDR, little endian (DDS-XTypes 1.3 §7.4.3, XCDR1).

Alignment counts from the end of the four bytes of the encapsulation header. A codec is built once
for each message class from the annotations of its fields.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from msgspec import Struct

from catenary.errors import DecodeError

HEADER = b"\x00\x01\x00\x00"  # CDR_LE, no options
PRIMITIVES = {
    "bool": struct.Struct("<?"),
    "byte": struct.Struct("<B"),
    "int32": struct.Struct("<i"),
    "uint32": struct.Struct("<I"),
    "int64": struct.Struct("<q"),
    "float64": struct.Struct("<d"),
}
COUNT = PRIMITIVES["uint32"]
PADDING = [bytes(count) for count in range(8)]

Encode = Callable[[bytearray, Any], None]
Message = TypeVar("Message", bound=Struct)


class Reader:
    """Position in the encoded message that is being read."""

    __slots__ = ("data", "position")

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = len(HEADER)

    def align(self, size: int) -> None:
        """Skip the padding in front of a value of `size` bytes."""
        self.position += (len(HEADER) - self.position) % size

    def take(self, count: int) -> bytes:
        """Return the next bytes.

        Raises:
            DecodeError: The message ends before.
        """
        start, end = self.position, self.position + count
        if end > len(self.data):
            raise DecodeError(f"message of {len(self.data)} bytes ends before byte {end}")
        self.position = end
        return self.data[start:end]

    def number(self, form: struct.Struct) -> Any:
        """Return the next value of a primitive type."""
        self.align(form.size)
        return form.unpack(self.take(form.size))[0]

    def numbers(self, count: int, form: struct.Struct) -> tuple[Any, ...]:
        """Return `count` values of a primitive type."""
        if not count:
            return ()
        self.align(form.size)
        data = self.take(count * form.size)
        return struct.unpack(f"<{count}{form.format[1:]}", data)

    def text(self) -> str:
        """Return the next string."""
        data = self.take(self.number(COUNT))
        if data[-1:] != b"\0":
            raise DecodeError("string without a final zero byte")
        try:
            return data[:-1].decode()
        except UnicodeDecodeError as error:
            raise DecodeError(f"string that is not UTF-8: {error}") from None

    def count(self) -> int:
        """Return the length of a sequence. No element takes less than one byte."""
        count: int = self.number(COUNT)
        if count > len(self.data) - self.position:
            raise DecodeError(f"sequence of {count} elements exceeds the message")
        return count


Decode = Callable[[Reader], Any]
Codec = tuple[Encode, Decode]


def encode(message: Struct) -> bytes:
    """Return a message as CDR with its encapsulation header.

    Raises:
        ValueError: A value does not fit its type.
    """
    buffer = bytearray(HEADER)
    try:
        _struct_codec(type(message))[0](buffer, message)
    except (struct.error, TypeError, AttributeError, UnicodeEncodeError) as error:
        raise ValueError(f"{type(message).__name__}: {error}") from error
    return bytes(buffer)


def decode(data: bytes, message: type[Message]) -> Message:
    """Return the message in `data`. Bytes after the last field are ignored: they are padding.

    Args:
        data: CDR with its encapsulation header.
        message: class of the message.

    Raises:
        DecodeError: The bytes are not a message of this class.
    """
    if data[:2] != HEADER[:2]:
        raise DecodeError(f"encapsulation {data[:2].hex()} is not CDR_LE (0001)")
    result: Message = _struct_codec(message)[1](Reader(data))
    return result


@cache
def _struct_codec(message: type[Struct]) -> Codec:
    hints = get_type_hints(message, include_extras=True)
    fields = [(name, _field_codec(hints[name])) for name in message.__struct_fields__]
    encoders = [(name, codec[0]) for name, codec in fields]
    decoders = [codec[1] for _, codec in fields]

    def encode_fields(buffer: bytearray, value: Any) -> None:
        for name, write in encoders:
            write(buffer, getattr(value, name))

    def decode_fields(reader: Reader) -> Any:
        return message(*[read(reader) for read in decoders])

    return encode_fields, decode_fields


def _field_codec(hint: Any) -> Codec:
    if isinstance(hint, type) and issubclass(hint, Struct):
        return _struct_codec(hint)
    if get_origin(hint) is Sequence:
        return _sequence_codec(_field_codec(get_args(hint)[0]))
    wire: str = hint.__metadata__[0]
    element, bracket, length = wire.rstrip("]").partition("[")
    if element == "string":
        return _sequence_codec(TEXT) if bracket else TEXT
    form = PRIMITIVES[element]
    if not bracket:
        return _number_codec(form)
    return _array_codec(form, int(length)) if length else _numbers_codec(form)


def _align(buffer: bytearray, size: int) -> None:
    excess = (len(buffer) - len(HEADER)) % size
    if excess:
        buffer += PADDING[size - excess]


def _encode_count(buffer: bytearray, count: int) -> None:
    _align(buffer, COUNT.size)
    buffer += COUNT.pack(count)


def _encode_text(buffer: bytearray, text: str) -> None:
    data = text.encode()
    if b"\0" in data:
        raise TypeError("a string cannot contain a zero byte")
    _encode_count(buffer, len(data) + 1)
    buffer += data + b"\0"


TEXT: Codec = (_encode_text, Reader.text)


def _number_codec(form: struct.Struct) -> Codec:
    def encode_number(buffer: bytearray, value: Any) -> None:
        _align(buffer, form.size)
        buffer += form.pack(value)

    return encode_number, lambda reader: reader.number(form)


def _encode_numbers(buffer: bytearray, form: struct.Struct, values: Sequence[Any]) -> None:
    if len(values):
        _align(buffer, form.size)
        buffer += struct.pack(f"<{len(values)}{form.format[1:]}", *values)


def _numbers_codec(form: struct.Struct) -> Codec:
    def encode_numbers(buffer: bytearray, values: Sequence[Any]) -> None:
        _encode_count(buffer, len(values))
        _encode_numbers(buffer, form, values)

    return encode_numbers, lambda reader: reader.numbers(reader.count(), form)


def _array_codec(form: struct.Struct, length: int) -> Codec:
    def encode_array(buffer: bytearray, values: Sequence[Any]) -> None:
        if len(values) != length:
            raise TypeError(f"expected {length} numbers, not {len(values)}")
        _encode_numbers(buffer, form, values)

    return encode_array, lambda reader: reader.numbers(length, form)


def _sequence_codec(element: Codec) -> Codec:
    write, read = element

    def encode_sequence(buffer: bytearray, values: Sequence[Any]) -> None:
        if isinstance(values, str):
            raise TypeError("expected a sequence, not a string")
        _encode_count(buffer, len(values))
        for value in values:
            write(buffer, value)

    def decode_sequence(reader: Reader) -> tuple[Any, ...]:
        return tuple([read(reader) for _ in range(reader.count())])

    return encode_sequence, decode_sequence

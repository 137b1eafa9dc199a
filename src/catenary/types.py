"""EtherCAT base data types with their CoE index numbers, ETG.1000.6 §5.6.7.3 and ETG.1020 (bit
types). Values are little endian.

    UINT.encode(5)              # b"\\x05\\x00"
    UINT.decode(b"\\x05\\x00")    # 5; its static type is int
    by_name("UNSIGNED16")       # UINT
"""

from __future__ import annotations

import math
import operator
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeAlias, TypeVar, cast

from catenary.errors import DecodeError

T = TypeVar("T")
Value: TypeAlias = bool | int | float | str | bytes


# No slots: `DataType[int]` as a base of a frozen class with slots fails in Python 3.11.
@dataclass(frozen=True)
class DataType(Generic[T]):
    """A data type. A `bit_length` of 0 means any number of bytes."""

    name: str
    index: int  # of its DEFTYPE object in the dictionary
    bit_length: int
    aliases: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Length of a single value in bytes; 0 if the type has no fixed length."""
        return (self.bit_length + 7) // 8

    def encode(self, value: T) -> bytes:
        """Return the encoded value.

        Raises:
            TypeError: The value has the wrong Python type.
            ValueError: The value is out of range.
        """
        raise NotImplementedError

    def decode(self, data: bytes) -> T:
        """Return the decoded value. Raises DecodeError if the bytes are not valid for this type."""
        raise NotImplementedError

    def parse(self, text: str) -> T:
        """Return the value that a text denotes, such as "0x1F". Raises ValueError if invalid."""
        raise NotImplementedError

    def __str__(self) -> str:
        return self.name

    def _check_size(self, data: bytes) -> None:
        if self.size and len(data) != self.size:
            raise DecodeError(f"{self.name}: needs {self.size} bytes, received {len(data)}")


class Boolean(DataType[bool]):
    """One bit. A single value takes one byte, and every byte except zero is true."""

    def encode(self, value: bool) -> bytes:
        if isinstance(value, str | bytes):  # "false" is true in Python
            raise TypeError(f"{self.name}: {value!r} is text; use True or False")
        return b"\x01" if value else b"\x00"

    def decode(self, data: bytes) -> bool:
        self._check_size(data)
        return data != b"\x00"

    def parse(self, text: str) -> bool:
        try:
            return {"0": False, "false": False, "1": True, "true": True}[text.strip().lower()]
        except KeyError:
            raise ValueError(
                f"{self.name}: invalid value {text!r}; use 0, 1, false or true"
            ) from None


@dataclass(frozen=True)
class Integer(DataType[int]):
    """An integer of 1 to 64 bits."""

    signed: bool = False

    @property
    def minimum(self) -> int:
        """Smallest value."""
        return -(1 << self.bit_length - 1) if self.signed else 0

    @property
    def maximum(self) -> int:
        """Largest value."""
        return (1 << self.bit_length - (1 if self.signed else 0)) - 1

    def encode(self, value: int) -> bytes:
        number = operator.index(value)
        self._check_range(number, ValueError)
        return number.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        self._check_size(data)
        number = int.from_bytes(data, "little", signed=self.signed)
        self._check_range(number, DecodeError)
        return number

    def parse(self, text: str) -> int:
        try:
            number = int(text.strip(), 0)
        except ValueError:
            raise ValueError(f"{self.name}: {text!r} is not an integer (12, -3, 0x1F)") from None
        self._check_range(number, ValueError)
        return number

    def _check_range(self, number: int, error: type[ValueError] | type[DecodeError]) -> None:
        if not self.minimum <= number <= self.maximum:
            raise error(f"{self.name}: {number} is not in {self.minimum} to {self.maximum}")


class Real(DataType[float]):
    """IEEE 754, 32 or 64 bits."""

    def encode(self, value: float) -> bytes:
        try:
            return struct.pack(self._format, value)
        except OverflowError:
            raise ValueError(f"{self.name}: {value} exceeds ±3.4028235e38") from None
        except struct.error:
            raise TypeError(f"{self.name}: {value!r} is not a number") from None

    def decode(self, data: bytes) -> float:
        self._check_size(data)
        return cast(float, struct.unpack(self._format, data)[0])

    def parse(self, text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            raise ValueError(f"{self.name}: {text!r} is not a number") from None
        if not math.isfinite(number):
            raise ValueError(f"{self.name}: {text!r} is not finite")
        self.encode(number)
        return number

    @property
    def _format(self) -> str:
        return "<f" if self.bit_length == 32 else "<d"


@dataclass(frozen=True)
class Text(DataType[str]):
    """Characters of a fixed width. Devices pad with NUL; `decode` stops at the first NUL."""

    encoding: str = "latin-1"

    def encode(self, value: str) -> bytes:
        if "\x00" in value:
            raise ValueError(f"{self.name}: {value!r} contains a NUL character")
        try:
            data = value.encode(self.encoding)
            if self.size and len(data) > self.size:
                raise ValueError(f"{self.name}: {value!r} is longer than {self.size} bytes")
            return data.ljust(self.size, b"\x00")
        except UnicodeEncodeError as error:
            raise ValueError(f"{self.name}: {value!r} cannot be encoded: {error.reason}") from None

    def decode(self, data: bytes) -> str:
        self._check_size(data)
        try:
            return data.decode(self.encoding).split("\x00", 1)[0]
        except UnicodeDecodeError as error:
            raise DecodeError(f"{self.name}: {error.reason} at byte {error.start}") from None

    def parse(self, text: str) -> str:
        self.encode(text)
        return text


class Octets(DataType[bytes]):
    """Uninterpreted bytes, of fixed or any length."""

    def encode(self, value: bytes) -> bytes:
        if self.size and len(value) != self.size:
            raise ValueError(f"{self.name}: needs exactly {self.size} bytes, got {len(value)}")
        return bytes(value)

    def decode(self, data: bytes) -> bytes:
        self._check_size(data)
        return bytes(data)

    def parse(self, text: str) -> bytes:
        try:
            return self.encode(bytes.fromhex(text.removeprefix("0x")))
        except ValueError as error:
            raise ValueError(f"{self.name}: {text!r}: {error}") from None


# Types that an array or a record may contain. Complete access transfers the whole object at once.
Scalar: TypeAlias = (
    DataType[bool] | DataType[int] | DataType[float] | DataType[str] | DataType[bytes]
)


class Array(DataType[tuple[T, ...]]):
    """`count` consecutive values of one type: `Array(UDINT, 4)`, decoded to a tuple."""

    element: DataType[T]
    count: int

    def __init__(self, element: DataType[T], count: int) -> None:
        _check_sized(element)
        if count < 1:
            raise ValueError(f"Array: count must be at least 1, got {count}")
        super().__init__(f"ARRAY [1..{count}] OF {element}", 0, count * element.bit_length)
        object.__setattr__(self, "element", element)
        object.__setattr__(self, "count", count)

    def encode(self, value: tuple[T, ...]) -> bytes:
        if len(value) != self.count:
            raise ValueError(f"{self.name}: needs {self.count} values, got {len(value)}")
        width = self.element.bit_length
        return _packed([(width, self.element.encode(each)) for each in value])

    def decode(self, data: bytes) -> tuple[T, ...]:
        self._check_size(data)
        return tuple(
            self.element.decode(part)
            for part in _unpacked(data, [self.element.bit_length] * self.count)
        )


class Record(DataType[Mapping[str, Value]]):
    """Consecutive named values: `Record({"vendor": UDINT, "product": UDINT})`, decoded to a dict.

    Entries of less than a byte are packed as in the object. Declare a gap as an unused field.
    """

    fields: Mapping[str, Scalar]

    def __init__(self, fields: Mapping[str, Scalar]) -> None:
        if not fields:
            raise ValueError("Record: needs at least one field")
        for kind in cast(Iterable[DataType[Value]], fields.values()):
            _check_sized(kind)
        name = f"STRUCT ({', '.join(f'{name}: {kind}' for name, kind in fields.items())})"
        super().__init__(name, 0, sum(kind.bit_length for kind in fields.values()))
        object.__setattr__(self, "fields", dict(fields))

    def encode(self, value: Mapping[str, Value]) -> bytes:
        if value.keys() != self.fields.keys():
            raise ValueError(
                f"{self.name}: needs every field, got values for {', '.join(value) or 'nothing'}"
            )
        kinds = cast(Mapping[str, DataType[Value]], self.fields)
        return _packed(
            [(kind.bit_length, kind.encode(value[name])) for name, kind in kinds.items()]
        )

    def decode(self, data: bytes) -> dict[str, Value]:
        self._check_size(data)
        parts = _unpacked(data, [kind.bit_length for kind in self.fields.values()])
        return {
            name: kind.decode(part)
            for (name, kind), part in zip(self.fields.items(), parts, strict=True)
        }


def sized(kind: DataType[T], size: int) -> DataType[T]:
    """Return a fixed-length variant of a type of any length: `sized(VISIBLE_STRING, 32)`.

    Args:
        kind: A type without a fixed length.
        size: The length [bytes].

    Raises:
        ValueError: The type already has a fixed length, or `size` is less than 1.
    """
    if kind.bit_length or size < 1:
        raise ValueError(
            f"{kind} of {size} bytes: needs a type without a fixed length, and at least 1 byte"
        )
    return replace(kind, name=f"{kind}({size})", bit_length=8 * size)


def _check_sized(kind: DataType[T]) -> None:
    if not kind.bit_length:
        raise ValueError(f"{kind} has no fixed size; use sized({kind}, 32)")


def _packed(parts: Sequence[tuple[int, bytes]]) -> bytes:
    """Return the values as packed bits, the first in the lowest bits."""
    number = bit = 0
    for width, data in parts:
        number |= int.from_bytes(data, "little") << bit
        bit += width
    return number.to_bytes((bit + 7) // 8, "little")


def _unpacked(data: bytes, widths: Sequence[int]) -> Iterator[bytes]:
    number = int.from_bytes(data, "little")
    for width in widths:
        yield (number & (1 << width) - 1).to_bytes((width + 7) // 8, "little")
        number >>= width


BOOL = Boolean("BOOL", 0x0001, 1, ("BOOLEAN", "BIT"))
SINT = Integer("SINT", 0x0002, 8, ("INTEGER8", "INT8"), signed=True)
INT = Integer("INT", 0x0003, 16, ("INTEGER16", "INT16"), signed=True)
DINT = Integer("DINT", 0x0004, 32, ("INTEGER32", "INT32"), signed=True)
USINT = Integer("USINT", 0x0005, 8, ("UNSIGNED8", "UINT8"))
UINT = Integer("UINT", 0x0006, 16, ("UNSIGNED16", "UINT16"))
UDINT = Integer("UDINT", 0x0007, 32, ("UNSIGNED32", "UINT32"))
REAL = Real("REAL", 0x0008, 32, ("REAL32", "FLOAT"))
VISIBLE_STRING = Text("VISIBLE_STRING", 0x0009, 0, ("STRING",))
OCTET_STRING = Octets("OCTET_STRING", 0x000A, 0, ("BYTES",))
UNICODE_STRING = Text("UNICODE_STRING", 0x000B, 0, ("WSTRING",), encoding="utf-16-le")
DOMAIN = Octets("DOMAIN", 0x000F, 0)
INT24 = Integer("INT24", 0x0010, 24, ("INTEGER24",), signed=True)
LREAL = Real("LREAL", 0x0011, 64, ("REAL64", "DOUBLE"))
INT40 = Integer("INT40", 0x0012, 40, ("INTEGER40",), signed=True)
INT48 = Integer("INT48", 0x0013, 48, ("INTEGER48",), signed=True)
INT56 = Integer("INT56", 0x0014, 56, ("INTEGER56",), signed=True)
LINT = Integer("LINT", 0x0015, 64, ("INTEGER64", "INT64"), signed=True)
UINT24 = Integer("UINT24", 0x0016, 24, ("UNSIGNED24",))
UINT40 = Integer("UINT40", 0x0018, 40, ("UNSIGNED40",))
UINT48 = Integer("UINT48", 0x0019, 48, ("UNSIGNED48",))
UINT56 = Integer("UINT56", 0x001A, 56, ("UNSIGNED56",))
ULINT = Integer("ULINT", 0x001B, 64, ("UNSIGNED64", "UINT64"))
GUID = Octets("GUID", 0x001D, 128)
BYTE = Integer("BYTE", 0x001E, 8)
WORD = Integer("WORD", 0x001F, 16)
DWORD = Integer("DWORD", 0x0020, 32)
BITARR8 = Integer("BITARR8", 0x002D, 8)
BITARR16 = Integer("BITARR16", 0x002E, 16)
BITARR32 = Integer("BITARR32", 0x002F, 32)
BIT1 = Integer("BIT1", 0x0030, 1)
BIT2 = Integer("BIT2", 0x0031, 2)
BIT3 = Integer("BIT3", 0x0032, 3)
BIT4 = Integer("BIT4", 0x0033, 4)
BIT5 = Integer("BIT5", 0x0034, 5)
BIT6 = Integer("BIT6", 0x0035, 6)
BIT7 = Integer("BIT7", 0x0036, 7)
BIT8 = Integer("BIT8", 0x0037, 8)

ALL = (
    *(BOOL, SINT, INT, DINT, USINT, UINT, UDINT, REAL, VISIBLE_STRING, OCTET_STRING),
    *(UNICODE_STRING, DOMAIN, INT24, LREAL, INT40, INT48, INT56, LINT, UINT24, UINT40, UINT48),
    *(UINT56, ULINT, GUID, BYTE, WORD, DWORD, BITARR8, BITARR16, BITARR32),
    *(BIT1, BIT2, BIT3, BIT4, BIT5, BIT6, BIT7, BIT8),
)
_BY_INDEX = {entry.index: entry for entry in ALL}
_BY_NAME = {name: entry for entry in ALL for name in (entry.name, *entry.aliases)}


def by_name(name: str) -> DataType[Value]:
    """Return the type with this PLC or CANopen name. Raises ValueError if the name is unknown.

    The comparison ignores case.
    """
    found = _BY_NAME.get(name.strip().upper())
    if found is None:
        known = ", ".join(entry.name for entry in ALL)
        raise ValueError(f"unknown data type {name!r}; known types: {known}")
    return cast(DataType[Value], found)


def by_index(index: int) -> DataType[Value]:
    """Return the type with this CoE index.

    Raises:
        ValueError: No base type has the index. It belongs to a structure or a vendor-specific type.
    """
    found = _BY_INDEX.get(index)
    if found is None:
        raise ValueError(f"no base data type has the index 0x{index:04X}")
    return cast(DataType[Value], found)

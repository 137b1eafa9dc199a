"""Channel: one object of a device's process data, as an application names it."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import SupportsIndex, TypeAlias, cast

from catenary.model.device import Entry
from catenary.plan.cycle import Bank, NumberKind
from catenary.plan.request import ObjectReference
from catenary.types import BOOL, Boolean, DataType, Integer, Real, by_index

NumberType: TypeAlias = DataType[bool] | DataType[int] | DataType[float]
BITS_MAX = 64


@dataclass(frozen=True, slots=True)
class Channel:
    """One number of a device's process data. A tuple (index, subindex, type[, scale]) is the same.

        Channel(0x6000, 0x11, types.INT, 1.196e-3, unit="m/s2")

    Args:
        index: Of the object, 1 to 0xFFFF.
        subindex: 0 to 0xFF.
        type: Of `catenary.types`: BOOL, an integer or a REAL of 1 to 64 bits.
        scale: Value = raw number · scale, a float. None: the raw number.
        unit: Unit of the value, for display.
        output: For `Drives(columns=...)` only: True if the column is written.

    Raises:
        TypeError: The type is not one of numbers.
        ValueError: A number is out of range.
    """

    index: int
    subindex: int
    type: NumberType
    scale: float | None = None
    _: KW_ONLY
    unit: str = ""
    output: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.index <= 0xFFFF or not 0 <= self.subindex <= 0xFF:
            raise ValueError(f"{self.place}: an index has 16 bits, a subindex 8")
        if not isinstance(self.type, Boolean | Integer | Real):
            shown = str(self.type) if isinstance(self.type, DataType) else repr(self.type)
            raise TypeError(
                f"{self.place}: {shown} is not a type of numbers; use BOOL, an integer or a "
                "REAL of catenary.types"
            )
        if self.scale is not None and not (math.isfinite(self.scale) and self.scale != 0):
            raise ValueError(f"{self.place}: scale {self.scale} must be finite and not 0")

    @property
    def place(self) -> str:
        """Index and subindex as text."""
        return f"0x{self.index:04X}:{self.subindex:02X}"

    @property
    def bit_length(self) -> int:
        return self.type.bit_length

    @property
    def kind(self) -> NumberKind:
        if isinstance(self.type, Real):
            return NumberKind.REAL
        signed = isinstance(self.type, Integer) and self.type.signed
        return NumberKind.SIGNED if signed else NumberKind.UNSIGNED

    @property
    def bank(self) -> Bank:
        """The array that has its values while a loop is open."""
        if self.scale is not None or self.kind is NumberKind.REAL:
            return Bank.REAL
        return Bank.BIT if self.bit_length == 1 else Bank.INTEGER

    def reference(self) -> ObjectReference:
        return ObjectReference(self.index, self.subindex, self.bit_length)

    def decode(self, raw: int) -> float | int:
        """Return the value of raw bits: a bool, an integer or a float."""
        value: float | int = raw
        if isinstance(self.type, Boolean):
            value = raw != 0
        elif isinstance(self.type, Real):
            value = self.type.decode(raw.to_bytes(self.type.size, "little"))
        elif self.kind is NumberKind.SIGNED and raw >> self.bit_length - 1:
            value = raw - (1 << self.bit_length)
        return value if self.scale is None else value * self.scale

    def encode(self, value: float | int) -> int:
        """Return the raw bits of a value.

        Raises:
            TypeError: An integer is needed.
            ValueError: The type cannot hold the value.
        """
        number = value if self.scale is None else value / self.scale
        if isinstance(self.type, Boolean):
            return self.type.encode(bool(number) if self.scale else value)[0]  # type: ignore[arg-type]
        if isinstance(self.type, Real):
            if not math.isfinite(number):
                raise ValueError(f"{value} is not finite")
            return int.from_bytes(self.type.encode(number), "little")
        assert isinstance(self.type, Integer)  # __post_init__ allows nothing else
        whole = operator.index(cast(SupportsIndex, number)) if self.scale is None else round(number)
        data = self.type.encode(whole)
        return int.from_bytes(data, "little") & ((1 << self.bit_length) - 1)


ChannelSpec: TypeAlias = Channel | tuple[int, int, NumberType] | tuple[int, int, NumberType, float]


def make_channel(option: str, name: str, spec: ChannelSpec) -> Channel:
    """Return the channel of an option such as `inputs={name: spec}`.

    Raises:
        TypeError: It is neither a Channel nor (index, subindex, type).
        ValueError: A number of it is out of range.
    """
    if isinstance(spec, Channel):
        return spec
    if not isinstance(spec, tuple) or len(spec) not in (3, 4):
        raise TypeError(f"{option}[{name!r}]: (index, subindex, type[, scale]), not {spec!r}")
    try:
        return Channel(*spec)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{option}[{name!r}]: {error}") from None


def make_channels(option: str, specs: Mapping[str, ChannelSpec]) -> dict[str, Channel]:
    """Return the channels of an option by name.

    Raises:
        TypeError: The option is not a mapping, or one of its values is not a channel.
        ValueError: A number is out of range.
    """
    if not isinstance(specs, Mapping):
        raise TypeError(f"{option}: {{name: (index, subindex, type)}}, not {specs!r}")
    return {name: make_channel(option, name, spec) for name, spec in specs.items()}


def channel_of(entry: Entry, scale: float | None = None) -> Channel:
    """Return the channel of a mapped entry. An entry of unknown type is an unsigned integer."""
    return Channel(entry.index, entry.subindex, _entry_type(entry), scale)


def _entry_type(entry: Entry) -> NumberType:
    bits = entry.bit_length
    try:
        known = by_index(entry.data_type)
    except ValueError:
        known = None
    if isinstance(known, Boolean | Real) and known.bit_length == bits:
        return known
    if isinstance(known, Integer) and known.bit_length == bits:
        return known
    if bits == 1:
        return BOOL
    signed = isinstance(known, Integer) and known.signed
    return Integer(f"{'INT' if signed else 'UINT'}{bits}", 0, bits, signed=signed)

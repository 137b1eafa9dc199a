"""Channel, which describes one object in the process data of a device."""

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
    """One number in the process data of a device.

        Channel(0x6000, 0x11, types.INT, 1.196e-3, unit="m/s2")

    Where an option accepts a Channel, it also accepts a tuple (index, subindex, type[, scale]).

    Args:
        index: index of the object, 1 to 0xFFFF.
        subindex: subindex of the object, 0 to 0xFF.
        type: numeric type of `catenary.types`: BOOL, an integer or a REAL, 1 to 64 bits.
        scale: factor from the raw number to the value, which is then a float; None for the raw
            number.
        unit: unit of the value, for display.
        output: True if the column is written. Used only by `Drives(columns=...)`.
        pdo: PDO that contains the object, if several do; 0 for any.

    Raises:
        TypeError: The type is not numeric.
        ValueError: A number is out of range.
    """

    index: int
    subindex: int
    type: NumberType
    scale: float | None = None
    _: KW_ONLY
    unit: str = ""
    output: bool = False
    pdo: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.index <= 0xFFFF or not 0 <= self.subindex <= 0xFF:
            raise ValueError(
                f"{self.place}: the index must be from 1 to 0xFFFF, the subindex from 0 to 0xFF"
            )
        if not isinstance(self.type, Boolean | Integer | Real):
            shown = str(self.type) if isinstance(self.type, DataType) else repr(self.type)
            raise TypeError(
                f"{self.place}: {shown} is not a numeric type; use BOOL, an integer or a REAL of "
                "catenary.types"
            )
        if self.scale is not None and not (math.isfinite(self.scale) and self.scale != 0):
            raise ValueError(f"{self.place}: scale {self.scale} must be finite and not 0")

    @property
    def place(self) -> str:
        """Index and subindex as text."""
        return f"0x{self.index:04X}:{self.subindex:02X}"

    @property
    def bit_length(self) -> int:
        """Length in the process data [bits]."""
        return self.type.bit_length

    @property
    def kind(self) -> NumberKind:
        """Kind of the raw number: signed, unsigned or real."""
        if isinstance(self.type, Real):
            return NumberKind.REAL
        signed = isinstance(self.type, Integer) and self.type.signed
        return NumberKind.SIGNED if signed else NumberKind.UNSIGNED

    @property
    def bank(self) -> Bank:
        """Array that contains the value while a loop is open."""
        if self.scale is not None or self.kind is NumberKind.REAL:
            return Bank.REAL
        return Bank.BIT if self.bit_length == 1 else Bank.INTEGER

    def reference(self) -> ObjectReference:
        """Return the object for a process-data request."""
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
            TypeError: The type needs an integer.
            ValueError: The value is out of the range of the type, or is not finite.
        """
        number = value if self.scale is None else value / self.scale
        if isinstance(self.type, Boolean):
            return self.type.encode(bool(number) if self.scale else value)[0]  # type: ignore[arg-type]
        if (self.scale is not None or isinstance(self.type, Real)) and not math.isfinite(number):
            raise ValueError(f"{value} is not finite")
        if isinstance(self.type, Real):
            return int.from_bytes(self.type.encode(number), "little")
        assert isinstance(self.type, Integer)  # __post_init__ rejects other types
        whole = operator.index(cast(SupportsIndex, number)) if self.scale is None else round(number)
        data = self.type.encode(whole)
        return int.from_bytes(data, "little") & ((1 << self.bit_length) - 1)


ChannelSpec: TypeAlias = Channel | tuple[int, int, NumberType] | tuple[int, int, NumberType, float]


def make_channel(option: str, name: str, spec: ChannelSpec) -> Channel:
    """Return one channel of an option such as `inputs={name: spec}`.

    Args:
        option: name of the option, for messages.
        name: name of the channel.
        spec: Channel, or (index, subindex, type[, scale]).

    Raises:
        TypeError: `spec` is neither a Channel nor such a tuple, or its type is not numeric.
        ValueError: A number is out of range.
    """
    if isinstance(spec, Channel):
        return spec
    if not isinstance(spec, tuple) or len(spec) not in (3, 4):
        raise TypeError(
            f"{option}[{name!r}] is {spec!r}; give a Channel or (index, subindex, type[, scale])"
        )
    try:
        return Channel(*spec)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{option}[{name!r}]: {error}") from None


def make_channels(option: str, specs: Mapping[str, ChannelSpec]) -> dict[str, Channel]:
    """Return the channels of an option by name.

    Args:
        option: name of the option, for messages.
        specs: Channel, or (index, subindex, type[, scale]), by name.

    Raises:
        TypeError: The option is not a mapping, or one of its values is not a channel.
        ValueError: A number is out of range.
    """
    if not isinstance(specs, Mapping):
        raise TypeError(f"{option}={specs!r}: give {{name: (index, subindex, type)}}")
    return {name: make_channel(option, name, spec) for name, spec in specs.items()}


def channel_of(entry: Entry, scale: float | None = None) -> Channel:
    """Return the channel of a mapped entry.

    If the type of the entry is unknown or has another length, the channel is BOOL for one bit.
    Otherwise it is an integer of the length of the entry, signed only if the known type is signed.

    Args:
        entry: mapped entry.
        scale: factor from the raw number to the value; None for the raw number.
    """
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
